# cmake -D OUT=page_files.cpp -D FOLDER=page -P embed.cmake: the files of a folder as a table of bytes in C++.
file(GLOB names RELATIVE ${FOLDER} ${FOLDER}/*)
list(SORT names)
set(arrays "")
set(rows "")
foreach(name ${names})
  get_filename_component(suffix ${name} LAST_EXT)
  if(suffix STREQUAL ".html")
    set(type "text/html; charset=utf-8")
  elseif(suffix STREQUAL ".css")
    set(type "text/css; charset=utf-8")
  elseif(suffix STREQUAL ".js")
    set(type "text/javascript; charset=utf-8")
  elseif(suffix STREQUAL ".svg")
    set(type "image/svg+xml")
  else()
    message(FATAL_ERROR "${FOLDER}/${name}: no content type for ${suffix}")
  endif()
  string(MAKE_C_IDENTIFIER "k_${name}" id)
  file(READ ${FOLDER}/${name} hex HEX)
  string(LENGTH "${hex}" digits)
  math(EXPR size "${digits} / 2")
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "\\\\x\\1" text "${hex}")
  string(APPEND arrays "constexpr char ${id}[] =\n    \"${text}\";\n")
  string(APPEND rows "    {\"/${name}\", \"${type}\", std::string_view(${id}, ${size})},\n")
endforeach()
file(WRITE ${OUT}.new "// Made by cmake/embed.cmake.
#include \"tools/view/page_files.hpp\"

namespace view {

namespace {

${arrays}
constexpr PageFile kFiles[] = {
${rows}};

}  // namespace

std::span<const PageFile> page_files() noexcept { return kFiles; }

}  // namespace view
")
file(RENAME ${OUT}.new ${OUT})

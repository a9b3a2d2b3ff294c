#include "tools/cli/top/top_screen.hpp"

#include <curses.h>
#include <langinfo.h>
#include <termios.h>
#include <unistd.h>

#include <clocale>
#include <cstdio>
#include <cstring>

namespace tools {

namespace {

constexpr short kGreen = 1, kYellow = 2, kRed = 3;

attr_t attributes_of(Tone tone) {
  switch (tone) {
    case Tone::kPlain:
      return A_NORMAL;
    case Tone::kHeading:
      return A_BOLD;
    case Tone::kGood:
      return static_cast<attr_t>(COLOR_PAIR(kGreen));
    case Tone::kWarn:
      return static_cast<attr_t>(A_BOLD | COLOR_PAIR(kYellow));
    case Tone::kBad:
      return static_cast<attr_t>(A_BOLD | COLOR_PAIR(kRed));
    case Tone::kDim:
      return A_DIM;
    case Tone::kChosen:
      return A_REVERSE;
  }
  return A_NORMAL;
}

}  // namespace

Screen::Screen() {
  // Characters only: figures keep their decimal point.
  std::setlocale(LC_CTYPE, "");
  utf8_ = std::strcmp(::nl_langinfo(CODESET), "UTF-8") == 0;
  // Not initscr(), which ends the process when it does not know the terminal.
  SCREEN* const terminal = ::newterm(nullptr, stdout, stdin);
  terminal_ = terminal;
  if (terminal == nullptr) return;
  ::set_term(terminal);
  ::cbreak();
  ::noecho();
  ::curs_set(0);
  ::keypad(stdscr, TRUE);
  ::set_escdelay(25);
  // Ctrl-\ would leave the terminal as it is now. The shell's settings come back with endwin().
  termios settings{};
  if (::tcgetattr(STDIN_FILENO, &settings) == 0) {
    settings.c_cc[VQUIT] = _POSIX_VDISABLE;
    ::tcsetattr(STDIN_FILENO, TCSANOW, &settings);
  }
  if (::has_colors()) {
    ::start_color();
    ::use_default_colors();
    ::init_pair(kGreen, COLOR_GREEN, -1);
    ::init_pair(kYellow, COLOR_YELLOW, -1);
    ::init_pair(kRed, COLOR_RED, -1);
  }
}

Screen::~Screen() {
  if (terminal_ == nullptr) return;
  ::endwin();
  ::delscreen(static_cast<SCREEN*>(terminal_));
}

int Screen::width() const noexcept { return COLS; }
int Screen::height() const noexcept { return LINES; }

void Screen::draw(const Lines& lines) {
  ::erase();
  for (std::size_t row = 0; row < lines.size(); ++row) {
    ::move(static_cast<int>(row), 0);
    for (const ViewLine::Part& part : lines[row].parts) {
      const attr_t attributes = attributes_of(part.tone);
      ::attron(attributes);
      ::addstr(part.text.c_str());
      ::attroff(attributes);
    }
  }
  ::refresh();
}

TopKey Screen::key(int wait_ms, bool& resized) {
  using Kind = TopKey::Kind;
  ::timeout(wait_ms);
  const int code = ::getch();
  switch (code) {
    case ERR:
      return {};
    case KEY_RESIZE:
      resized = true;
      return {};
    case '\t':
    case KEY_DOWN:
    case KEY_RIGHT:
      return {Kind::kNext};
    case KEY_BTAB:
    case KEY_UP:
    case KEY_LEFT:
      return {Kind::kPrevious};
    case KEY_PPAGE:
      return {Kind::kPageUp};
    case KEY_NPAGE:
      return {Kind::kPageDown};
    case 27:
      return {Kind::kEscape};
    default:
      break;
  }
  if (code > 0 && code < 128) return {Kind::kCharacter, static_cast<char>(code)};
  return {};
}

}  // namespace tools

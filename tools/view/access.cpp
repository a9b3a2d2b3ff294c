#include "tools/view/access.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <vector>

namespace view {

namespace {

constexpr std::size_t kTokenDigits = 32;

bool is_port(std::string_view text) {
  return !text.empty() && text.size() <= 5 &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool is_token(std::string_view text) {
  return text.size() == kTokenDigits &&
         std::all_of(text.begin(), text.end(), [](unsigned char c) { return std::isxdigit(c) != 0; });
}

std::string random_token() {
  std::array<unsigned char, kTokenDigits / 2> bytes{};
  if (::getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) std::abort();
  std::string text;
  for (const unsigned char byte : bytes) {
    text += "0123456789abcdef"[byte >> 4U];
    text += "0123456789abcdef"[byte & 15U];
  }
  return text;
}

std::vector<std::filesystem::path> token_folders() {
  std::vector<std::filesystem::path> out;
  for (const char* const name : {"XDG_RUNTIME_DIR", "XDG_CACHE_HOME"}) {
    if (const char* const folder = std::getenv(name); folder != nullptr && *folder == '/') out.emplace_back(folder);
  }
  if (const char* const home = std::getenv("HOME"); home != nullptr && *home == '/') {
    out.push_back(std::filesystem::path(home) / ".cache");
  }
  return out;
}

/// The token of a file that belongs to us and that nobody else may read; "": there is none.
std::string read_token(const std::filesystem::path& file) {
  const int fd = ::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return "";
  struct stat about {};
  std::array<char, kTokenDigits> text{};
  const bool ours =
      ::fstat(fd, &about) == 0 && S_ISREG(about.st_mode) && about.st_uid == ::geteuid() && (about.st_mode & 077U) == 0;
  const ssize_t got = ours ? ::read(fd, text.data(), text.size()) : 0;
  ::close(fd);
  const std::string token(text.data(), got > 0 ? static_cast<std::size_t>(got) : 0);
  return is_token(token) ? token : "";
}

}  // namespace

bool allowed_host(std::string_view host) {
  std::string_view name = host;
  if (host.starts_with('[')) {
    const std::size_t end = host.find(']');
    if (end == std::string_view::npos) return false;
    name = host.substr(1, end - 1);
    const std::string_view rest = host.substr(end + 1);
    in6_addr address{};
    return (rest.empty() || (rest[0] == ':' && is_port(rest.substr(1)))) &&
           ::inet_pton(AF_INET6, std::string(name).c_str(), &address) == 1;
  }
  if (const std::size_t colon = host.find(':'); colon != std::string_view::npos) {
    if (!is_port(host.substr(colon + 1))) return false;
    name = host.substr(0, colon);
  }
  in_addr address{};
  return name == "localhost" || ::inet_pton(AF_INET, std::string(name).c_str(), &address) == 1;
}

bool allowed_origin(std::string_view origin, std::string_view host) {
  return origin.empty() || (origin.starts_with("http://") && origin.substr(7) == host);
}

bool same_token(std::string_view a, std::string_view b) noexcept {
  if (a.size() != b.size()) return false;
  unsigned different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) different |= static_cast<unsigned char>(a[i] ^ b[i]);
  return different == 0;
}

std::string view_token() {
  const std::string fresh = random_token();
  for (const std::filesystem::path& folder : token_folders()) {
    std::error_code error;
    std::filesystem::create_directories(folder / "rtbus", error);
    const std::filesystem::path file = folder / "rtbus" / "view_token";
    if (std::string kept = read_token(file); !kept.empty()) return kept;
    ::unlink(file.c_str());  // not ours to believe
    const int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (fd < 0) continue;
    const bool written = ::write(fd, fresh.data(), fresh.size()) == static_cast<ssize_t>(fresh.size());
    ::close(fd);
    if (written) return fresh;
  }
  return fresh;
}

}  // namespace view

#pragma once
/// @file chromium.hpp
/// A headless Chromium, driven by its debugging pipe: JSON messages that end with a zero byte, on descriptors 3 and 4
/// of the browser (Chrome DevTools Protocol). WebGL is rendered in software.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "rtbus/clock.hpp"

namespace tests {

/// The first of the usual names that is in the PATH; "": Chromium is not there.
inline std::string find_chromium() {
  const char* const path = std::getenv("PATH");
  for (const char* const name : {"chromium", "chromium-browser", "google-chrome"}) {
    std::string_view rest = path != nullptr ? path : "";
    while (!rest.empty()) {
      const std::size_t end = std::min(rest.find(':'), rest.size());
      const std::string file = std::string(rest.substr(0, end)) + "/" + name;
      if (::access(file.c_str(), X_OK) == 0) return file;
      rest.remove_prefix(std::min(end + 1, rest.size()));
    }
  }
  return "";
}

/// One browser with one profile of its own. Throws std::runtime_error when it does not answer for 30 s.
class Chromium {
 public:
  using Json = nlohmann::json;

  Chromium() : folder_(std::filesystem::temp_directory_path() / ("rtbus_chromium_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(folder_);
    int to_browser[2], from_browser[2];
    if (::pipe2(to_browser, O_CLOEXEC) != 0 || ::pipe2(from_browser, O_CLOEXEC) != 0) throw std::runtime_error("pipe");
    const std::string program = find_chromium(), profile = "--user-data-dir=" + folder_.string();
    pid_ = ::fork();
    if (pid_ == 0) start(program, profile, to_browser[0], from_browser[1]);
    ::close(to_browser[0]);
    ::close(from_browser[1]);
    write_fd_ = to_browser[1];
    read_fd_ = from_browser[0];
  }
  ~Chromium() {
    ::close(write_fd_);  // it ends when nobody drives it any more
    ::close(read_fd_);
    for (int i = 0; i < 400 && ::waitpid(pid_, nullptr, WNOHANG) == 0; ++i) ::usleep(10'000);
    ::kill(-pid_, SIGKILL);
    ::waitpid(pid_, nullptr, WNOHANG);
    std::error_code error;
    std::filesystem::remove_all(folder_, error);
  }
  Chromium(const Chromium&) = delete;
  Chromium& operator=(const Chromium&) = delete;

  /// Calls a method and waits for its result. @param session "": the browser itself.
  Json call(const std::string& method, const Json& parameters = Json::object(), const std::string& session = "") {
    Json message = {{"id", ++last_id_}, {"method", method}, {"params", parameters}};
    if (!session.empty()) message["sessionId"] = session;
    std::string text = message.dump();
    text.push_back('\0');
    for (std::size_t done = 0; done < text.size();) {
      const ssize_t wrote = ::write(write_fd_, text.data() + done, text.size() - done);
      if (wrote <= 0) throw std::runtime_error("Chromium takes no message");
      done += static_cast<std::size_t>(wrote);
    }
    while (true) {
      Json answer = receive();
      if (answer.value("id", 0) != last_id_) {
        note(answer);
      } else if (answer.contains("error")) {
        throw std::runtime_error(method + ": " + answer["error"].dump());
      } else {
        return answer["result"];
      }
    }
  }

  /// What the pages complained about: exceptions, errors and warnings of their consoles and the network.
  [[nodiscard]] const std::vector<std::string>& complaints() const noexcept { return complaints_; }
  void forget_complaints() { complaints_.clear(); }

 private:
  [[noreturn]] static void start(const std::string& program, const std::string& profile, int in, int out) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    ::setpgid(0, 0);
    // Beyond 3 and 4 first, so that neither overwrites the other; dup2 clears the flag that closes them.
    const int from = ::fcntl(in, F_DUPFD, 10), to = ::fcntl(out, F_DUPFD, 10);
    ::dup2(from, 3);
    ::dup2(to, 4);
    ::close(from);
    ::close(to);
    const int nothing = ::open("/dev/null", O_RDWR);
    for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nothing, fd);
    ::execl(program.c_str(), program.c_str(), "--headless=new", "--no-sandbox", "--use-angle=swiftshader",
            "--enable-unsafe-swiftshader", "--hide-scrollbars", "--remote-debugging-pipe", "--window-size=960,540",
            "--no-first-run", "--disable-background-timer-throttling", "--disable-dev-shm-usage", profile.c_str(),
            static_cast<char*>(nullptr));
    ::_exit(127);
  }

  Json receive() {
    std::size_t end = buffer_.find('\0');
    while (end == std::string::npos) {
      pollfd waits{read_fd_, POLLIN, 0};
      char bytes[65536];
      if (::poll(&waits, 1, 30'000) != 1) throw std::runtime_error("Chromium is silent");
      const ssize_t got = ::read(read_fd_, bytes, sizeof bytes);
      if (got <= 0) throw std::runtime_error("Chromium has ended");
      buffer_.append(bytes, static_cast<std::size_t>(got));
      end = buffer_.find('\0');
    }
    Json message = Json::parse(buffer_.substr(0, end));
    buffer_.erase(0, end + 1);
    return message;
  }

  void note(const Json& event) {
    const std::string method = event.value("method", "");
    if (method == "Runtime.exceptionThrown") complaints_.push_back(event["params"]["exceptionDetails"].dump());
    if (method == "Log.entryAdded") complaints_.push_back(event["params"]["entry"].dump());
    if (method == "Runtime.consoleAPICalled" && event["params"].value("type", "") != "log") {
      complaints_.push_back(event["params"]["args"].dump());
    }
  }

  std::filesystem::path folder_;
  pid_t pid_ = -1;
  int write_fd_ = -1, read_fd_ = -1;
  int last_id_ = 0;
  std::string buffer_;
  std::vector<std::string> complaints_;
};

/// One tab in a window of its own: tabs behind others draw nothing. Closed by the destructor.
class Tab {
 public:
  using Json = nlohmann::json;

  explicit Tab(Chromium& browser, int width = 960, int height = 540) : browser_(browser) {
    target_ = browser_.call("Target.createTarget", {{"url", "about:blank"}, {"newWindow", true}})["targetId"]
                  .get<std::string>();
    session_ = browser_.call("Target.attachToTarget", {{"targetId", target_}, {"flatten", true}})["sessionId"]
                   .get<std::string>();
    for (const char* const domain : {"Runtime", "Log", "Page"}) call(std::string(domain) + ".enable");
    call("Emulation.setDeviceMetricsOverride",
         {{"width", width}, {"height", height}, {"deviceScaleFactor", 1}, {"mobile", false}});
  }
  ~Tab() {
    try {
      browser_.call("Target.closeTarget", {{"targetId", target_}});
    } catch (const std::exception&) {
    }
  }
  Tab(const Tab&) = delete;
  Tab& operator=(const Tab&) = delete;

  Json call(const std::string& method, const Json& parameters = Json::object()) {
    return browser_.call(method, parameters, session_);
  }
  void open(const std::string& url) { call("Page.navigate", {{"url", url}}); }
  /// Value of an expression, awaited when it is a promise. Throws when it throws.
  Json evaluate(const std::string& expression) {
    const Json result =
        call("Runtime.evaluate", {{"expression", expression}, {"returnByValue", true}, {"awaitPromise", true}});
    if (result.contains("exceptionDetails")) throw std::runtime_error(expression + ": " + result.dump());
    return result["result"].value("value", Json());
  }
  /// Asks every 20 ms until the expression is true; false after `timeout_s`. How soon a page shows something is no
  /// promise of it: a browser that draws in software on a busy machine takes its time.
  bool becomes(const std::string& expression, double timeout_s = 60.0) {
    const std::uint64_t end_ns = rtbus::monotonic_ns() + rtbus::ns_of(timeout_s);
    while (rtbus::monotonic_ns() < end_ns) {
      if (evaluate("Boolean(" + expression + ")").get<bool>()) return true;
      ::usleep(20'000);
    }
    return false;
  }
  /// What the page shows, as PNG in base64.
  std::string screenshot() { return call("Page.captureScreenshot")["data"].get<std::string>(); }

 private:
  Chromium& browser_;
  std::string target_, session_;
};

}  // namespace tests

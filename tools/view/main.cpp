// The program behind `rtbus view`: a session, live, in a browser. A program of its own, so that nothing else maps a web
// library or opens a socket.
#include <cstdio>
#include <memory>
#include <string>
#include <utility>

#include "rtbus/config/document.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/common/find_config.hpp"
#include "tools/cli/common/interrupt.hpp"
#include "tools/view/access.hpp"
#include "tools/view/live_source.hpp"
#if RTBUS_WITH_HDF5
#include "tools/view/recording_source.hpp"
#endif
#include "tools/view/server.hpp"

namespace {

struct ViewCommand {
  view::LiveOptions live;
  view::OrderOptions orders;
  std::string recording;  ///< File; "": live.
  std::string address = "127.0.0.1";
  int port = 7125;
};

int serve(ViewCommand& command) {
  try {
    if (!command.live.config.empty()) command.live.config = tools::find_session(command.live.config);
  } catch (const rtbus::config::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return tools::kExitUsage;
  }
  command.orders.session = command.live.session;
  view::MakeSource make_source = [&] { return std::make_shared<view::LiveSource>(command.live); };
  if (!command.recording.empty()) {
#if RTBUS_WITH_HDF5
    auto recording = view::RecordingSource::open(command.recording);
    if (!recording) {
      std::fprintf(stderr, "rtbus view: %s\n", recording.error().c_str());
      return tools::kExitFailed;
    }
    command.orders.live = false;
    make_source = [source = *recording] { return source; };
#else
    std::fputs("rtbus view: this build reads no recordings; build it with HDF5 (RTBUS_WITH_HDF5)\n", stderr);
    return tools::kExitFailed;
#endif
  }
  auto server =
      view::Server::open({command.address, command.port, view::view_token()}, command.orders, std::move(make_source));
  if (!server) {
    std::fprintf(stderr, "rtbus view: %s\n", server.error().c_str());
    return tools::kExitFailed;
  }
  if (command.address != "127.0.0.1" && command.address != "::1") {
    std::fprintf(stderr,
                 "rtbus view: other machines can reach this page, and nothing is encrypted; safer: "
                 "ssh -L %d:127.0.0.1:%d\n",
                 command.port, command.port);
  }
  std::printf("%s\n", (*server)->url().c_str());
  std::fflush(stdout);
  (*server)->serve([] { return tools::interrupted(); });
  return tools::kExitFine;
}

tools::Action add_view(rtbus::Command command) {
  const auto options = std::make_shared<ViewCommand>();
  command.option("FILE.h5", options->recording, "Recording to show; without it: a session, live");
  command.option("-s,--session", options->live.session, "Session; not needed while only one is live")
      .type_name("SESSION");
  command.option("--port", options->port, "Port of the page; 0: any that is free").show_default().whole_range(0, 65535);
  command
      .option("--listen", options->address, "Numeric address to listen on; other than 127.0.0.1 lets other machines in")
      .show_default()
      .type_name("ADDRESS");
  command.flag("--read-only", options->orders.read_only, "Of the orders, take E-stop alone");
  command.option("--record-to", options->orders.record_to, "Folder for the recordings that the page begins")
      .type_name("DIR")
      .show_default();
  command.option("--config", options->live.config, "Session file, when the session's own cannot be found out")
      .type_name("FILE|NAME");
  command.option("--set", options->live.assignments, "With --config: its changed keys")
      .take_all()
      .type_name("KEY=VALUE");
  command.footer("Prints the address to open in a browser and serves it until Ctrl-C. docs/viewer.md.");
  return [options] { return serve(*options); };
}

constexpr tools::CommandEntry kCommands[] = {{"view", "Show a session in a browser, live, or a recording", &add_view}};

}  // namespace

int main(int argc, char** argv) { return tools::run_commands(kCommands, "", argc, argv); }

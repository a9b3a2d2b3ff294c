// `rtbus estop`: zero force in a session, held until it is re-armed.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/orders/emergency_stop.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace tools {

namespace {

struct EstopOptions {
  std::optional<std::string> session;
  std::string reason;
  bool rearm = false;
};

int estop(const EstopOptions& options) {
  const auto session = choose_session(rtbus::list_topics(), options.session);
  if (!session) {
    std::fprintf(stderr, "rtbus estop: %s\n", session.error().message.c_str());
    return session.error().exit_status;
  }
  if (!options.rearm) {
    const auto done = emergency_stop(*session, options.reason);
    if (!done) std::fprintf(stderr, "rtbus estop: %s\n", done.error().c_str());
    if (done) std::puts(done->c_str());
    return done ? kExitFine : kExitFailed;
  }
  const auto reply = send_order(*session, {{"order", "rearm"}});
  if (!reply || !reply->value("ok", false)) {
    std::fprintf(stderr, "rtbus estop: %s\n", (reply ? reply->value("error", "refused") : reply.error()).c_str());
    return kExitFailed;
  }
  std::puts("re-armed: force ramps up");
  return kExitFine;
}

}  // namespace

Action add_estop(rtbus::Command command) {
  auto options = std::make_shared<EstopOptions>();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  command.option("--reason", options->reason, "Shown by the monitors, at most 95 bytes").type_name("TEXT");
  command.flag("--rearm", options->rearm, "Allow forces again: they ramp up as at the start");
  command.footer(
      "The force is zero within 100 ms and stays so until --rearm. When `rtbus run` does not answer, the haptic nodes\n"
      "are ended instead (SIGTERM), which sends zero force too. docs/safety.md.");
  return [options] { return estop(*options); };
}

}  // namespace tools

// `rtbus adjust`: changes a gain of a running session, where its file allows that.
#include <charconv>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/orders/order_socket.hpp"

namespace tools {

namespace {

struct AdjustOptions {
  std::string assignment;
  std::optional<std::string> session;
  bool json = false;
};

void print(const nlohmann::json& state) {
  if (state["adjustable"].empty()) std::puts("nothing: no haptic entry of the session names keys in `adjustable`");
  for (const auto& each : state["adjustable"]) {
    std::printf("%s = %g %s (at most %g)\n", each["key"].get<std::string>().c_str(), each["value"].get<double>(),
                each["unit"].get<std::string>().c_str(), each["most"].get<double>());
  }
}

int adjust(const AdjustOptions& options) {
  const auto session = choose_session(rtbus::list_topics(), options.session);
  if (!session) {
    std::fprintf(stderr, "rtbus adjust: %s\n", session.error().message.c_str());
    return session.error().exit_status;
  }
  nlohmann::json order{{"order", "state"}};
  if (!options.assignment.empty()) {
    const std::size_t equals = options.assignment.find('=');
    double value = 0.0;
    const char* const end = options.assignment.data() + options.assignment.size();
    if (equals == std::string::npos || std::from_chars(options.assignment.data() + equals + 1, end, value).ptr != end) {
      std::fprintf(stderr, "rtbus adjust: '%s' is not KEY=NUMBER, for example haptic0.coupling.stiffness_n_per_m=250\n",
                   options.assignment.c_str());
      return kExitUsage;
    }
    order = {{"order", "adjust"}, {"key", options.assignment.substr(0, equals)}, {"value", value}};
  }
  const auto reply = send_order(*session, order);
  if (!reply || !reply->value("ok", false)) {
    std::fprintf(stderr, "rtbus adjust: %s\n", (reply ? reply->value("error", "refused") : reply.error()).c_str());
    return kExitFailed;
  }
  if (options.json) {
    std::printf("%s\n", reply->dump(2).c_str());
  } else {
    print(*reply);
  }
  return kExitFine;
}

}  // namespace

Action add_adjust(rtbus::Command command) {
  auto options = std::make_shared<AdjustOptions>();
  command.option("KEY=VALUE", options->assignment,
                 "What to change; without it: what may be changed, and its value now");
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  command.flag("--json", options->json, "The answer as JSON, schema rtbus-orders/1");
  command.footer("A haptic entry of the session file names what may change: adjustable: [coupling.stiffness_n_per_m].");
  return [options] { return adjust(*options); };
}

}  // namespace tools

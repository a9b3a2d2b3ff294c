// `rtbus mark TEXT`: notes an event in the recordings that are under way.
#include <iostream>
#include <memory>
#include <optional>
#include <string>

#include "rtbus/clock.hpp"
#include "rtbus/topic_directory.hpp"
#include "tools/cli/common/choose.hpp"
#include "tools/cli/common/command.hpp"
#include "tools/cli/orders/marks.hpp"

namespace tools {

Action add_mark(rtbus::Command command) {
  struct Options {
    std::string text;
    std::optional<std::string> session;
  };
  auto options = std::make_shared<Options>();
  command.option("TEXT", options->text, "What happened, at most 255 bytes").required();
  command.option("-s,--session", options->session, "Session; not needed while only one is live").type_name("SESSION");
  return [options] {
    const std::uint64_t now_ns = rtbus::monotonic_ns();  // before anything else: this is when it happened
    const auto session = choose_session(rtbus::list_topics(), options->session);
    if (!session) {
      std::cerr << "rtbus mark: " << session.error().message << '\n';
      return session.error().exit_status;
    }
    const int taken = send_mark(*session, {now_ns, options->text});
    if (taken == 0) {
      std::cerr << "rtbus mark: nobody records the session " << *session << "; start `rtbus record FILE.h5` first\n";
      return kExitFailed;
    }
    std::cout << "marked in " << taken << (taken == 1 ? " recording" : " recordings") << " of " << *session << '\n';
    return kExitFine;
  };
}

}  // namespace tools

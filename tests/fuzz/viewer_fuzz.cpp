// What a page, or whatever pretends to be one, may send to the viewer: messages, one a line, after the right token or
// without it; and the heads of its request.
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <string>
#include <string_view>

#include "rtbus/clock.hpp"
#include "tools/view/access.hpp"
#include "tools/view/page_client.hpp"
#include "tools/view/playback.hpp"
#include "tools/view/protocol.hpp"
#include "tools/view/server.hpp"

namespace {

using namespace view;

constexpr const char* kToken = "0123456789abcdef0123456789abcdef";

void require(bool condition) {
  if (!condition) std::abort();
}

class Source final : public FrameSource {
 public:
  Source() {
    scene_.number = 1;
    scene_.document = {{"type", "scene"}};
    state_.set({{"type", "state"}});
    figures_.set({{"type", "figures"}});
    frame_.number = 1;
  }
  void follow() override { ++frame_.number; }
  std::string session() const override { return "fuzz-none"; }
  const ViewScene* scene() const override { return &scene_; }
  const ViewFrame& frame() const override { return frame_; }
  const Document& state() const override { return state_; }
  const Document& figures() const override { return figures_; }
  Playback* playback() override { return &playback_; }

 private:
  ViewScene scene_;
  ViewFrame frame_;
  Document state_, figures_;
  Playback playback_{10.0};
};

OrderOptions options(bool live) {
  OrderOptions out;
  out.session = "fuzz-none";  // no session has that name: an order ends at its socket, which is not there
  out.live = live;
  return out;
}

void talk(std::string_view messages, bool welcome, bool live) {
  std::uint64_t now_ns = 1000 * rtbus::kNsPerS;
  SessionOrders orders(options(live));
  PageClient client(kToken, orders, now_ns);
  Source source;
  if (welcome) client.receive(std::string(R"({"token":")") + kToken + "\"}", &source, now_ns);
  const bool knows_token = welcome || messages.find(kToken) != std::string_view::npos;
  while (!messages.empty()) {
    const std::size_t end = std::min(messages.find('\n'), messages.size());
    now_ns += rtbus::kNsPerMs;
    client.receive(messages.substr(0, end), &source, now_ns);
    source.follow();
    source.playback()->advance(now_ns);
    require(source.playback()->at_s() >= 0.0 && source.playback()->at_s() <= 10.0);
    while (const auto out = client.next(&source, now_ns)) require(out->bytes.size() >= kMessageRoom);
    messages.remove_prefix(std::min(end + 1, messages.size()));
  }
  require(knows_token || client.frames_sent() == 0);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0 || size > ServerLimits::kMessageBytes) return 0;
  const std::string_view text(reinterpret_cast<const char*>(data + 1), size - 1);
  talk(text, (data[0] & 1) != 0, (data[0] & 2) != 0);
  const std::size_t middle = text.size() / 2;
  const std::string_view host = text.substr(0, middle);
  (void)allowed_host(host);
  if (allowed_origin(text.substr(middle), host)) require(text.substr(middle).empty() || text.size() > 7);
  require(same_token(text, text));
  return 0;
}

#include "tools/view/page_client.hpp"

#include <algorithm>
#include <utility>

#include "rtbus/clock.hpp"
#include "tools/view/access.hpp"
#include "tools/view/server.hpp"

namespace view {

namespace {

using Json = nlohmann::ordered_json;

/// For a page that sends orders and reads nothing.
constexpr std::size_t kMostAnswers = 16;

PageClient::Outgoing text_message(const std::string& text) {
  PageClient::Outgoing out;
  out.bytes.reserve(kMessageRoom + text.size());
  out.bytes.resize(kMessageRoom);
  out.bytes.insert(out.bytes.end(), text.begin(), text.end());
  return out;
}

PageClient::Outgoing text_message(const Json& document) {
  return text_message(document.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

const char* to_string(Refusal refusal) noexcept {
  switch (refusal) {
    case Refusal::kNone:
      break;
    case Refusal::kBadMessage:
      return "a message that is not of this protocol";
    case Refusal::kTooMany:
      return "too many messages in one second";
    case Refusal::kTooLong:
      return "a message longer than 4096 bytes";
    case Refusal::kTooManyPages:
      return "8 pages are open already: close one";
    case Refusal::kWrongToken:
      return "wrong key: open the address that rtbus view has printed";
    case Refusal::kNoToken:
      return "no key: open the address that rtbus view has printed";
  }
  return "";
}

void PageClient::check_patience(std::uint64_t now_ns) noexcept {
  if (!welcome_ && now_ns > came_ns_ + ServerLimits::kPatience_s * rtbus::kNsPerS) refuse(Refusal::kNoToken);
}

void PageClient::receive(std::string_view text, FrameSource* source, std::uint64_t now_ns) {
  if (refusal_ != Refusal::kNone) return;
  if (now_ns > second_ns_ + rtbus::kNsPerS) {
    second_ns_ = now_ns;
    messages_ = 0;
  }
  if (++messages_ > ServerLimits::kMessages_per_s) return refuse(Refusal::kTooMany);
  const nlohmann::json message = nlohmann::json::parse(text, nullptr, false);
  if (!message.is_object()) return refuse(Refusal::kBadMessage);
  if (!welcome_) {
    const auto token = message.find("token");
    const bool right =
        token != message.end() && token->is_string() && same_token(token->get_ref<const std::string&>(), token_);
    if (!right) return refuse(Refusal::kWrongToken);
    welcome_ = true;
    heard_ns_ = now_ns;
    return;
  }
  if (const auto ack = message.find("ack"); ack != message.end()) {
    if (!ack->is_number_unsigned() || ack->get<std::uint64_t>() > sent_) return refuse(Refusal::kBadMessage);
    acknowledged_ = std::max(acknowledged_, ack->get<std::uint64_t>());
    heard_ns_ = now_ns;
  } else if (const auto order = message.find("order"); order != message.end()) {
    const OrderAnswer answer = orders_->take(*order, now_ns);
    const Json said = {{"type", "answer"}, {"taken", answer.taken}, {"text", answer.text}};
    answers_.push_back(said.dump(-1, ' ', false, Json::error_handler_t::replace));
    if (answers_.size() > kMostAnswers) answers_.pop_front();
  } else if (const auto play = message.find("play"); play != message.end()) {
    if (source != nullptr && source->playback() != nullptr) source->playback()->take(*play, now_ns);
  } else {
    refuse(Refusal::kBadMessage);
  }
}

bool PageClient::looks(std::uint64_t now_ns) const noexcept {
  return welcome_ && refusal_ == Refusal::kNone && now_ns < heard_ns_ + ServerLimits::kLooking_s * rtbus::kNsPerS;
}

bool PageClient::has_credit() const noexcept {
  return sent_ < acknowledged_ + static_cast<std::uint64_t>(ServerLimits::kUnacknowledged);
}

bool PageClient::frame_due(const FrameSource& source) const {
  return has_credit() && source.scene() != nullptr && source.frame().number != cursor_.number;
}

bool PageClient::wants(const FrameSource* source) const {
  if (refusal_ != Refusal::kNone) return true;
  if (!welcome_) return false;
  if (!greeted_ || !answers_.empty() || orders_->state().number != orders_state_) return true;
  if (source == nullptr) return false;
  if (source->id() != source_ || source->state().number != state_) return true;
  if (source->playback_state().number != playback_) return true;
  if (!has_credit()) return false;
  const ViewScene* const scene = source->scene();
  return (scene != nullptr && (scene->number != scene_ || meshes_ < scene->meshes.size())) ||
         source->figures().number != figures_ || frame_due(*source);
}

std::optional<PageClient::Outgoing> PageClient::next_document(const FrameSource& source) {
  if (const ViewScene* const scene = source.scene(); scene != nullptr) {
    if (scene->number != scene_) {
      scene_ = scene->number;
      meshes_ = 0;
      cursor_ = {};
      return text_message(scene->document);
    }
    if (meshes_ < scene->meshes.size()) return Outgoing{encode_mesh(*scene, meshes_++), true};
  }
  if (source.figures().number != figures_) {
    figures_ = source.figures().number;
    return text_message(source.figures().json);
  }
  return std::nullopt;
}

std::optional<PageClient::Outgoing> PageClient::next(const FrameSource* source, std::uint64_t now_ns) {
  if (!welcome_) return std::nullopt;
  if (!greeted_) {
    greeted_ = true;
    return text_message({{"type", "hello"}, {"protocol", kProtocol}, {"version", RTBUS_VERSION}});
  }
  if (!answers_.empty()) {
    const std::string answer = std::move(answers_.front());
    answers_.pop_front();
    return text_message(answer);
  }
  if (orders_->state().number != orders_state_) {
    orders_state_ = orders_->state().number;
    return text_message(orders_->state().json);
  }
  if (source == nullptr) return std::nullopt;
  if (source->id() != source_) {
    source_ = source->id();
    scene_ = 0;
    state_ = figures_ = playback_ = 0;
  }
  // Small, rare, and red in time also where pictures take long: not counted among what is under way.
  if (source->state().number != state_) {
    state_ = source->state().number;
    return text_message(source->state().json);
  }
  if (source->playback_state().number != playback_) {
    playback_ = source->playback_state().number;
    return text_message(source->playback_state().json);
  }
  if (!has_credit()) return std::nullopt;
  if (auto document = next_document(*source)) return document;
  if (!frame_due(*source)) return std::nullopt;
  ++sent_;
  return Outgoing{encode_frame(*source->scene(), source->frame(), source->clock_s(now_ns), sent_, cursor_), true};
}

}  // namespace view

#include "tools/cli/top/top_keys.hpp"

#include "tools/cli/top/top_view.hpp"

namespace tools {

namespace {

constexpr std::size_t kScroll = 5;

/// The neighbour of `name`, round and round.
template <class Named>
void step(const std::vector<Named>& all, std::string& name, bool forward) {
  if (all.empty()) return;
  const std::size_t at = chosen_index(all, name);
  name = all[(at + (forward ? 1 : all.size() - 1)) % all.size()].name;
}

void move_on(const TopSnapshot& snapshot, TopChoice& choice, bool forward) {
  if (choice.page == TopPage::kTopics) {
    step(snapshot.topics, choice.topic, forward);
    choice.scroll = 0;
  } else {
    step(snapshot.haptic, choice.node, forward);
  }
}

/// How many fields the chosen topic page may be scrolled is known to the view alone, which stops at the last one.
void scroll(TopChoice& choice, bool down) {
  if (choice.page != TopPage::kTopics) return;
  if (down) {
    choice.scroll += kScroll;
  } else {
    choice.scroll -= choice.scroll < kScroll ? choice.scroll : kScroll;
  }
}

bool apply_character(char character, const TopSnapshot& snapshot, TopChoice& choice) {
  if (character == 'q' || character == 'Q') return false;
  if (choice.page == TopPage::kHelp) {
    choice.page = TopPage::kOverview;  // any key leaves the help
    return true;
  }
  switch (character) {
    case 'p':
    case ' ':
      choice.paused = !choice.paused;
      break;
    case 't':
      choice.page = choice.page == TopPage::kTopics ? TopPage::kOverview : TopPage::kTopics;
      break;
    case 'u':
      choice.si = !choice.si;
      break;
    case 'h':
    case '?':
      choice.page = TopPage::kHelp;
      break;
    default:
      if (character >= '1' && character <= '9') {
        const auto index = static_cast<std::size_t>(character - '1');
        if (snapshot.session.empty() && index < snapshot.sessions.size()) choice.session = snapshot.sessions[index];
      }
      break;
  }
  return true;
}

}  // namespace

bool apply_key(const TopKey& key, const TopSnapshot& snapshot, TopChoice& choice) {
  using Kind = TopKey::Kind;
  if (key.kind == Kind::kNone) return true;
  if (key.kind == Kind::kCharacter) return apply_character(key.character, snapshot, choice);
  if (key.kind == Kind::kEscape || choice.page == TopPage::kHelp) {
    choice.page = TopPage::kOverview;
  } else if (key.kind == Kind::kNext || key.kind == Kind::kPrevious) {
    move_on(snapshot, choice, key.kind == Kind::kNext);
  } else {
    scroll(choice, key.kind == Kind::kPageDown);
  }
  return true;
}

}  // namespace tools

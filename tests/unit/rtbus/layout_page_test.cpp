// docs/shared-memory-layout.md is what tools in other languages are written from: its numbers are those of the code.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "rtbus/contact_messages.hpp"
#include "rtbus/detail/layout.hpp"
#include "rtbus/link_messages.hpp"
#include "rtbus/messages.hpp"
#include "rtbus/network_messages.hpp"
#include "rtbus/order_messages.hpp"
#include "rtbus/shape_messages.hpp"

namespace rtbus {
namespace {

/// The rows of the page's table that begins with `heading`, cell by cell, without blanks and backticks around them.
std::vector<std::vector<std::string>> rows_below(const std::string& heading) {
  std::ifstream page(std::string(RTBUS_SOURCE_DIR) + "/docs/shared-memory-layout.md");
  std::vector<std::vector<std::string>> rows;
  bool inside = false;
  for (std::string line; std::getline(page, line);) {
    if (inside && !line.starts_with('|')) break;
    if (inside && !line.starts_with("|--")) {
      auto& row = rows.emplace_back();
      for (std::size_t from = 1, to = line.find('|', from); to != line.npos; from = to + 1, to = line.find('|', from)) {
        const std::size_t first = line.find_first_not_of(" `", from), last = line.find_last_not_of(" `", to - 1);
        row.push_back(first < to ? line.substr(first, last - first + 1) : "");
      }
    }
    inside = inside || line.starts_with(heading);
  }
  return rows;
}

/// "10,176" is 10176.
std::size_t number(std::string text) {
  std::erase(text, ',');
  return text.find_first_not_of("0123456789") == text.npos && !text.empty() ? std::stoul(text) : 0;
}

template <class... Samples>
std::map<std::string, std::size_t> sizes() {
  return {{std::string(SampleTraits<Samples>::kName), sizeof(Samples)}...};
}

TEST(LayoutPage, GivesTheSizeOfEverySample) {
  std::map<std::string, std::size_t> told;
  for (const auto& row : rows_below("| topic | sample | bytes |")) {
    ASSERT_EQ(row.size(), 4U) << row.front();
    told["rtbus/" + row[1]] = number(row[2]);
  }
  EXPECT_EQ(
      told,
      (sizes<DeviceState, ProxyState, Heartbeat, NodeInfo, LoopStats, Telemetry, StepStats, BodyPoses, SoftNodes,
             PlantCommand, PlantState, ProxyContacts, LinkStats, NetworkStats, Orders, ContactPoints, BodyShapes>()));
}

#define MEMBER(name)                                                                      \
  {                                                                                       \
#name, { offsetof(detail::SegmentHeader, name), sizeof(detail::SegmentHeader::name) } \
  }

TEST(LayoutPage, GivesThePlaceOfEveryMemberOfTheHeader) {
  using Place = std::pair<std::size_t, std::size_t>;
  std::map<std::string, Place> told;
  for (const auto& row : rows_below("| offset | bytes | name |")) {
    ASSERT_EQ(row.size(), 4U) << row.front();
    if (number(row[0]) == sizeof(detail::SegmentHeader)) break;  // the fields begin
    told[row[2]] = {number(row[0]), number(row[1])};
  }
  const std::map<std::string, Place> is{
      MEMBER(magic),     MEMBER(layout_version),  MEMBER(header_bytes), MEMBER(type_hash),     MEMBER(sample_bytes),
      MEMBER(capacity),  MEMBER(slot_stride),     MEMBER(field_count),  MEMBER(segment_bytes), MEMBER(doorbell_offset),
      MEMBER(type_name), MEMBER(writer_start_ns), MEMBER(writer_pid),   MEMBER(epoch),         MEMBER(newest)};
  EXPECT_EQ(told, is);
}

}  // namespace
}  // namespace rtbus

// printer SESSION TOPIC: prints the newest sample of any topic, field by field. The type need not be known here.
#include <cstdio>

#include "rtbus/topic_directory.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: printer SESSION TOPIC\n");
    for (const rtbus::TopicInfo& topic : rtbus::list_topics()) {
      std::fprintf(stderr, "  %s %s\n", topic.session.c_str(), topic.topic.c_str());
    }
    return 2;
  }
  rtbus::Session session;
  session.name = argv[1];
  auto reader = rtbus::RawReader::open(session, argv[2]);
  if (!reader) {
    std::fprintf(stderr, "%s: %s\n", argv[2], rtbus::to_string(reader.error()));
    return 1;
  }
  if (reader->read_latest() != rtbus::ReadStatus::kFresh) {
    std::fprintf(stderr, "%s: nothing has been published yet\n", argv[2]);
    return 1;
  }
  std::printf("%s #%llu\n", reader->description().type_name.c_str(),
              static_cast<unsigned long long>(reader->sequence()));
  rtbus::visit_fields(reader->bytes(), reader->description(),
                      [](const std::string& label, const std::string& unit, const rtbus::FieldValue& value) {
                        std::printf("  %s = %s %s\n", label.c_str(), rtbus::to_text(value).c_str(), unit.c_str());
                      });
}

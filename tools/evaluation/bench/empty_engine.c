/* An engine of an empty world, in C: for `rtbus bench external`. Each tool is at once where the hand is. */
#include <string.h>

#include "rtbus_engine.h"

int main(void) {
  rtbus_engine* engine = NULL;
  rtbus_engine_info info;
  rtbus_engine_step step;
  memset(&info, 0, sizeof info);
  memset(&step, 0, sizeof step);
  info.struct_bytes = sizeof info;
  step.struct_bytes = sizeof step;
  if (rtbus_engine_open(NULL, &engine) < 0 || rtbus_engine_get_info(engine, &info) < 0) return 1;
  while (rtbus_engine_begin(engine, &step) >= 0) {
    uint32_t i;
    if (step.due == 0) continue;
    for (i = 0; i < info.hands; ++i) {
      rtbus_engine_hand hand;
      rtbus_engine_tool tool;
      memset(&tool, 0, sizeof tool);
      hand.struct_bytes = sizeof hand;
      tool.struct_bytes = sizeof tool;
      if (rtbus_engine_get_hand(engine, i, &hand) < 0) return 1;
      memcpy(tool.position_m, hand.target_position_m, sizeof tool.position_m);
      if (rtbus_engine_set_tool(engine, i, &tool) < 0) return 1;
    }
    if (rtbus_engine_finish(engine) < 0) return 1;
  }
  rtbus_engine_close(engine);
  return 0;
}

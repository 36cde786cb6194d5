// What a wheel was told against what its encoder says. See watch.h.
#include "watch.h" // this file's manual

#include "messages.h" // enum fault

void watch_init(struct watch *watch, uint16_t left_um_per_count, uint16_t right_um_per_count)
{
    *watch = (struct watch){.um_per_count = {left_um_per_count, right_um_per_count}};
}

uint8_t watch_update(struct watch *watch, const struct watch_wheel wheels[DRIVE_SIDES])
{
    (void)watch;
    (void)wheels;
    return FAULT_NONE;
}

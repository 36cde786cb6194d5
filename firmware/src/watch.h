// What a wheel was told against what its encoder says.
#ifndef WATCH_H
#define WATCH_H

#include <stdint.h> // integers of known width

#include "drive.h" // sides

// One wheel at a tick: what was put out at the last one, and what has come of it.
struct watch_wheel {
    int16_t setpoint_q4; // speed it was told, sixteenths of mm/s
    int16_t duty;        // voltage put out for that; 0 while it brakes or coasts
    int32_t count;       // of its encoder
    int16_t speed_q4;    // by its encoder
};

struct watch {
    uint16_t um_per_count[DRIVE_SIDES];
};

void watch_init(struct watch *watch, uint16_t left_um_per_count, uint16_t right_um_per_count);

// Every tick; enum fault, FAULT_NONE if all is plausible.
uint8_t watch_update(struct watch *watch, const struct watch_wheel wheels[DRIVE_SIDES]);

#endif

// A move from standstill to standstill: straight on by a distance, or a turn on the spot by an angle.
//
// Both wheels go equally far, forward or back. The profile follows from the way that is left, so nothing
// needs to be caught up with: it speeds up by the ramp, slows down by half of it, and over the last
// centimetres ever more, since there every count tells where a wheel truly is and what its motor does at so
// slow a speed. What one wheel is ahead of the other is taken off its setpoint and added to the other's,
// which holds the heading of a straight move and the place of a turn. Each wheel is braked at its own end,
// short of it by what it rolls out.
//
// A move ends by itself unless a wheel is held; then it goes on pushing, and to notice that is not done here.
#ifndef MOVE_H
#define MOVE_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "drive.h" // sides and limits

struct move {
    int32_t start_um[DRIVE_SIDES]; // travel of either wheel when it began
    int32_t way_um;                // to go, of either wheel; not negative
    int16_t cruise_q4;             // fastest on the way
    int16_t step_q4;               // most the speed changes in a tick
    int16_t speed_q4;              // of the profile at the last tick
    int8_t sign[DRIVE_SIDES];      // which way either wheel goes: 1 or -1
    bool arrived[DRIVE_SIDES];     // that wheel is braked: it rolls out to its end
    uint8_t still;                 // ticks since both have arrived and neither has moved
    int32_t last_um[DRIVE_SIDES];  // travel at the last tick
};

// Begin; the wheels stand at this travel (motor_travel_um). Speed and rate above 0; beyond the limits they
// are cut. distance_mm: forward positive. angle_mrad: positive to the right.
void move_begin_straight(struct move *move, const struct drive_limits *limits, int16_t distance_mm,
                         uint16_t speed_mm_s, int32_t left_um, int32_t right_um);
void move_begin_turn(struct move *move, const struct drive_limits *limits, int16_t angle_mrad,
                     uint16_t rate_mrad_s, int32_t left_um, int32_t right_um);

// One tick: the wheels' setpoints. True when the move is at its end and the wheels stand; setpoints are then
// zero.
bool move_update(struct move *move, int32_t left_um, int32_t right_um, int16_t setpoint_q4[DRIVE_SIDES]);

// The wheels were braked meanwhile: the profile starts again from speed zero, the way that is left stays.
void move_pause(struct move *move);

#endif

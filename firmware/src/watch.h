// What the wheels were told against what their encoders say.
//
//   ENCODER_DEAD      a wheel is driven and its count gets no further, while the other one turns (or is told
//                     to stand); one channel without the other counts to and fro, which gets no further
//                     either
//   STALL             no wheel that is driven gets further
//   ENCODER_REVERSED  a wheel is driven one way and counts the other: its channels, its motor's wires, or the
//                     two wheels' encoders are swapped
//   RUNAWAY           a wheel is far faster than it was told, or keeps turning after its motor was turned off
//
// A count is missed by any of these signs:
//   - the wheel went on steadily at 10 cm/s or more, as told; had it kept its pace, or only that which it was
//     told since, it would have gone two and a half counts. Edges may come one and a half counts apart;
//   - its motor has been given what moves any wheel, on carpet and uphill too, for long enough to do it;
//   - it has been told at 10 cm/s or more to go a way that even a stiff wheel would have begun.
// A slow wheel, which friction may hold for a second, is missed by the second sign, and by a fourth: it has been
// told to go 20 cm, whatever its motor was given. Gains too small to move a wheel cannot hide a dead encoder.
//
// All this is for counts of up to 1 cm. Of 2 cm each, a stiff wheel may now and then be called dead while it
// starts; of 4 cm, speeds are known too late to tell who runs away.
//
// Encoders are all there is to feel with, so some things look alike, and are told as follows:
//   - one wheel that is blocked while the other turns: ENCODER_DEAD, as if its encoder were;
//   - both encoders dead, or unplugged: STALL, as if both wheels were blocked. The robot then drives blind
//     for 0.4 s, as long as a doorstep may hold two wheels that will climb it;
//   - a wheel turned by hand, or by a slope, after it has come to stand or while it coasts: nothing, even if
//     it is a motor that a broken driver turns on;
//   - swapped encoders on the way straight on: nothing, until the wheels are told to differ, or the loop has
//     driven them so far apart that one seems dead or runs away.
#ifndef WATCH_H
#define WATCH_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "drive.h" // sides

// One wheel at a tick: what was put out at the last one, and what has come of it.
struct watch_wheel {
    int16_t setpoint_q4; // speed it was told, sixteenths of mm/s; 0 while its motor is off
    int16_t duty;        // voltage put out for that
    int16_t speed_q4;    // by its encoder
    int32_t count;       // of its encoder
};

// What a wheel is believed to be.
struct watch_model {
    uint16_t um_per_count;
    int16_t static_duty; // as struct motor_gains
    int16_t velocity_q8;
};

// One wheel, watched. Ways are sums of speeds over ticks.
struct watch_side {
    uint16_t um_per_count;
    uint16_t static_duty; // as in its model
    uint16_t velocity_q8; // likewise
    uint32_t way_q4;      // two and a half counts, but at least 1 cm
    uint32_t pushed_most; // duty beyond what moves any wheel, summed up, that moves it so far
    uint16_t furthest;    // count, low bits, since it was first told to go this way
    uint16_t mark;        // count, low bits, beyond which it gets further than it was a while ago
    uint32_t told_q4;     // way told since it last did
    uint32_t asked_q4;    // the part of it told at no less than an ordinary speed
    uint32_t paced_q4;    // way it would have gone since at the speed it had, or that it was told if less
    uint32_t pushed;      // duty beyond what moves any wheel since then
    uint16_t pace_q4;     // the speed it had then
    uint16_t rolling_q4;  // speed the other way when it was first told to go this way
    uint16_t lately_q4;   // fastest it was told, forgotten bit by bit
    uint16_t lately_duty; // most that was put out, likewise
    uint8_t turned;       // counts made this way, up to those that make a pace
    uint8_t silent;       // ticks driven since then, at most 255
    uint8_t fast;         // ticks in a row faster than told, those far faster counted sixteen times
    int8_t direction;     // that it was told: 1, -1, or 0
    bool retreated;       // it stands one count behind `mark`
    uint8_t stood;        // ticks it has stood since it was last driven, up to those that count
};

struct watch {
    struct watch_side sides[DRIVE_SIDES];
    int32_t turn_from[DRIVE_SIDES]; // counts when this turn began
    uint32_t turn_told;             // way told, of the left wheel before the right one
    uint16_t turn_rolling_q4;       // difference in speed the other way when it began
    int8_t turn;                    // 1: to the right, the left wheel is told to be the faster one; -1; or 0
};

void watch_init(struct watch *watch, const struct watch_model models[DRIVE_SIDES]);

// Every tick; enum fault, FAULT_NONE if all is plausible. coasting: motors that are off are open, and nothing
// stops the wheels.
uint8_t watch_update(struct watch *watch, const struct watch_wheel wheels[DRIVE_SIDES], bool coasting);

#endif

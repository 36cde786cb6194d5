// A robot for C tests that rolls: the whole firmware on hardware of variables, with motors, wheels and
// encoders that can be unlike each other, hindered, pushed and broken.
#ifndef ROLLING_ROBOT_H
#define ROLLING_ROBOT_H

#include "fake_hal.h" // hardware of variables
#include "robot.h"    // the firmware

// One motor, its wheel and its encoder. Speeds in mm/s; forces in shares of the full duty that would overcome
// them.
struct rolling_wheel {
    // What it is
    double full_mm_s;    // at full duty and 7.4 V, without friction
    double lag_s;        // time constant of the motor
    double friction;     // duty that just overcomes it
    double mm_per_count; // truly
    double uneven[4];    // by how much of a count each of four edges comes late

    // What happens to it
    double drag;    // more friction: carpet
    double slope;   // a force, forward positive
    bool blocked;   // held fast
    bool pushed;    // by hand, at push_mm_s
    double push_mm_s;

    // What is broken
    bool dead[2];     // channel A, B: keeps its level
    bool reversed;    // the channels are swapped
    bool stuck;       // the driver puts out stuck_duty whatever it is told
    double stuck_duty;

    // Where it is
    double mm_s, mm;
    int64_t cell;  // count by its position
    uint8_t level; // its pins without what is broken
};

struct rolling {
    struct hal hal;
    struct robot robot;
    struct rolling_wheel wheels[DRIVE_SIDES];
    bool swapped;       // each encoder is wired to the other wheel's pins
    double battery_v;   // without load
    double sag_v;       // less with both motors at full duty
    uint32_t now_us;
    uint8_t seq;
    uint16_t request;
};

// Two gear motors alike on a full battery, standing; the robot has just been started.
void rolling_init(struct rolling *rolling);

// Until the next tick, and that tick.
void rolling_tick(struct rolling *rolling);
void rolling_ms(struct rolling *rolling, unsigned ms);

// Messages, as a host in session sends them. Deadlines are 200 ms ahead.
void rolling_hello(struct rolling *rolling);
void rolling_drive(struct rolling *rolling, int v_mm_s, int omega_mrad_s);
void rolling_stop(struct rolling *rolling, uint8_t how);
void rolling_clear(struct rolling *rolling);
void rolling_move(struct rolling *rolling, int distance_mm, unsigned speed_mm_s);
void rolling_turn(struct rolling *rolling, int angle_mrad, unsigned rate_mrad_s);
void rolling_keep_alive(struct rolling *rolling);

// Drive for so long, as a host does, with a DRIVE every 50 ms.
void rolling_drive_ms(struct rolling *rolling, unsigned ms, int v_mm_s, int omega_mrad_s);

#endif

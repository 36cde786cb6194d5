// Where one wheel is and how fast it turns between its edges.
//
// At 0.1 m/s an edge comes every tenth tick; what an encoder tells is late and coarse. Here a simple motor is
// kept in step with the real one: every tick it turns as its wheel was told, and every edge says how far it
// was off. From that it learns three things: the wheel's place and speed now, its drift (how much faster it
// runs than it is told, for every motor differs), and where in its first count it stood at the start.
//
//   speed   goes to what was told with a lag of 60 ms; told nothing, it is braked and comes to rest
//   place   from the last edge on; never past the next edge, which has not come
//   drift   a share of every error in speed. At the start it is taken to be WHEEL_DRIFT_Q4, until edges
//           tell: a motor better than expected would jump off, a worse one only starts a little later
//
// The first edge alone cannot tell how far the wheel has come, for it may have stood anywhere between two
// edges. The first five can: the speed at the first one follows from them, and a wheel that gained this speed
// evenly from rest has gone speed^2 / (2 * acceleration).
#ifndef WHEEL_H
#define WHEEL_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "encoder.h" // counts and edges

#define WHEEL_DRIFT_Q4 360    // 22.5 mm/s
#define WHEEL_STUCK_TICKS 10  // held at an edge that does not come for so long: something holds the wheel
#define WHEEL_SPEED_Q4 32000  // 2 m/s, the fastest it is taken to be

struct wheel {
    // What its motor says of the present tick.
    int16_t told_q4; // speed it should go to, sixteenths of mm/s; 0: it is braked
    bool full;       // the motor has no more to give
    bool hard;       // it pushes hard: what holds the wheel is to be pushed no harder

    int32_t speed_q12; // sixteenths of mm/s, times 256
    int32_t drift_q12; // the same; faster than told
    int32_t edge_um;   // travel at the last edge
    int32_t part_16um; // since then, in sixteenths of micrometres
    bool placed;       // the encoder was looked at
    uint16_t border;   // of counts, where that edge was
    int8_t direction;  // of that edge
    uint8_t ticks;     // driven since that edge or since setting out, 60 at most
    uint8_t stuck;     // ticks in which it should have come to the next edge

    uint8_t learn_q8;       // share of an error in speed that becomes drift
    int16_t drift_limit_q4; // most of it, either way

    // From the start until the fifth edge.
    uint8_t edges;           // come so far, 5 at most
    uint8_t first_ticks;     // driven until the first
    uint8_t first_share_q8;  // of a drift that showed in the speed by then
    int16_t first_speed_q4;  // then, forward or backward
    int16_t first_step_q4;   // what it had gained in a tick
    int16_t first_drift_q4;  // as then believed
    uint16_t first_um;       // way from the start to the first edge, as now believed
};

// It stands somewhere in the count that the first update tells.
void wheel_init(struct wheel *wheel, uint8_t learn_q8, int16_t drift_limit_q4);

// Its motor is turned on, forward (1) or backward (-1): what was learned of another drive is forgotten.
void wheel_start(struct wheel *wheel, int8_t direction);

// One tick, after encoder_update() and with what was told since the last one.
void wheel_update(struct wheel *wheel, const struct encoder *encoder);

// Speed, sixteenths of mm/s, and travel since the start, forward positive. Travel may jump when an edge
// comes, by as much as the place was wrong, and once when the fifth edge tells where the wheel began.
int16_t wheel_speed_q4(const struct wheel *wheel);
int32_t wheel_travel_um(const struct wheel *wheel);

#endif

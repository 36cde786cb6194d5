// Quadrature encoder of one wheel: counts, faults of the signal, and speed from the time between edges.
//
// One count is about 0.5 cm, so a wheel at 0.1 m/s gives 20 counts a second. Counts per control tick would
// read 0, 0, 1, 0, ...; the time between edges holds far more. Hence two halves:
//
//   interrupt half   struct encoder_edges and encoder_edge(). A few byte operations per edge: the phase, a
//                    count modulo 256, and when it happened. Nothing else touches this struct.
//   main-loop half   struct encoder and encoder_update(), called every control tick with a copy of the
//                    interrupt half. Widens the counts to 32 bits and works out the speed.
//
// The copy must be taken with interrupts off (hal_interrupts_off); that is the only atomic section there is.
// It loses nothing while ticks come within 127 counts and 131 ms of each other.
//
// Forward is A leading B. Pins are given as (B << 1) | A and run 00, 01, 11, 10, 00 when rolling forward.
#ifndef ENCODER_H
#define ENCODER_H

#include <stdint.h> // integers of known width

#define ENCODER_STAMP_US 4                // unit of an edge's 16-bit time: one tick of timer 0 at clock/64
#define ENCODER_HISTORY 8                 // edges remembered; five are needed to see one phase twice
#define ENCODER_STILL_US INT32_C(500000)  // no edge for this long: the wheel stands
#define ENCODER_SPEED_MAX_Q4 32000        // 2 m/s; a faster reading is cut to this
#define ENCODER_NO_EDGE_US UINT32_MAX     // age of an edge that never came, or came over 2^31 us ago

// What the interrupt writes.
struct encoder_edges {
    uint8_t phase;    // 0..3: where in the cycle 00, 01, 11, 10 the pins were last seen
    uint8_t count;    // counts since start, modulo 256
    int8_t direction; // of the last counted edge: +1 forward, -1 backward, 0 before the first
    uint8_t illegal;  // transitions that changed both pins at once, modulo 256; they do not count
    uint16_t stamp;   // when the last counted edge came, in ENCODER_STAMP_US, modulo 65536
};

struct encoder_mark {
    uint16_t count; // position just after an edge, low bits
    uint32_t us;    // when that edge came
};

struct encoder {
    int32_t count;         // counts since start, forward positive
    uint16_t illegal;      // transitions in which both pins changed: two counts were lost, either way. Wraps.
    uint32_t edge_age_us;  // from the last counted edge to the last update, or ENCODER_NO_EDGE_US
    int8_t direction;      // of that edge; 0 before the first
    int16_t speed_q4;      // mm/s in sixteenths, forward positive

    struct encoder_edges seen;                  // the interrupt half as it was at the last update
    struct encoder_mark marks[ENCODER_HISTORY]; // newest first; all in one direction, none across a fault
    uint8_t mark_count;
    uint32_t last_edge_us;
    uint32_t scale;    // speed_q4 = scale * counts / microseconds
    uint16_t span_max; // most counts that may be multiplied by scale in 32 bits
    uint16_t um_per_count;
};

// Phase of a pair of pins: Gray code to binary, so that neighbours differ by one.
static inline uint8_t encoder_phase(uint8_t pins)
{
    return (uint8_t)((pins ^ (pins >> 1)) & 3);
}

// Start from the pins as they are, so that the first interrupt is no false edge.
void encoder_edges_init(struct encoder_edges *edges, uint8_t pins);

// Note that a pin may have changed. Safe to call when none did. Inline, because it lives in an interrupt.
static inline void encoder_edge(struct encoder_edges *edges, uint8_t pins, uint16_t stamp)
{
    uint8_t phase = encoder_phase(pins);
    uint8_t step = (uint8_t)((phase - edges->phase) & 3);
    edges->phase = phase;
    if (step == 2) {
        edges->illegal++;
    } else if (step != 0) {
        int8_t direction = step == 1 ? 1 : -1;
        edges->direction = direction;
        edges->count = (uint8_t)(edges->count + (uint8_t)direction);
        edges->stamp = stamp;
    }
}

// Start at zero. um_per_count: travel of the wheel's rim in one count, 1 to 40000 micrometres.
void encoder_init(struct encoder *encoder, const struct encoder_edges *edges, uint16_t um_per_count);

// The same wheel with another size of count, from now on: nothing else is forgotten.
void encoder_rescale(struct encoder *encoder, uint16_t um_per_count);

// Take in what the interrupt half recorded. `edges` is a copy made with interrupts off at about now_us.
//
// Speed is distance over time between the newest edge and the latest earlier edge of the same phase and
// direction: A and B need not be a quarter apart, nor high and low equally wide, for this to be exact. With
// no such edge (just started, or edges closer together than ticks, of which only the last is seen) the oldest
// remembered edge serves. Between edges the speed is bounded by "an edge would have come": one and a half
// counts, since uneven phases may stretch one count that far, over the time since the last edge. After
// ENCODER_STILL_US without one it is zero.
void encoder_update(struct encoder *encoder, const struct encoder_edges *edges, uint32_t now_us);

#endif

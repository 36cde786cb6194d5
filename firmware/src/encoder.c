// Quadrature encoder of one wheel: widening the interrupt's counts, and speed from edge times.
#include "encoder.h" // this file's manual

#include <stdbool.h> // bool

void encoder_edges_init(struct encoder_edges *edges, uint8_t pins)
{
    *edges = (struct encoder_edges){.phase = encoder_phase(pins)};
}

void encoder_init(struct encoder *encoder, const struct encoder_edges *edges, uint16_t um_per_count)
{
    *encoder = (struct encoder){
        .edge_age_us = ENCODER_NO_EDGE_US,
        .seen = *edges,
    };
    encoder_rescale(encoder, um_per_count);
}

void encoder_rescale(struct encoder *encoder, uint16_t um_per_count)
{
    encoder->um_per_count = um_per_count;
    encoder->scale = (uint32_t)um_per_count * 16000u;
    uint32_t span = UINT32_MAX / encoder->scale;
    encoder->span_max = span > UINT16_MAX ? UINT16_MAX : (uint16_t)span;
}

// scale * counts / us, within int16_t
static int16_t speed_of(const struct encoder *encoder, uint16_t counts, uint32_t us)
{
    if (counts > encoder->span_max || us == 0)
        return ENCODER_SPEED_MAX_Q4;
    uint32_t speed = encoder->scale * counts / us;
    return speed > ENCODER_SPEED_MAX_Q4 ? ENCODER_SPEED_MAX_Q4 : (int16_t)speed;
}

static void push_mark(struct encoder *encoder)
{
    if (encoder->mark_count < ENCODER_HISTORY)
        encoder->mark_count++;
    for (uint8_t i = (uint8_t)(encoder->mark_count - 1); i > 0; i--)
        encoder->marks[i] = encoder->marks[i - 1];
    encoder->marks[0] = (struct encoder_mark){(uint16_t)encoder->count, encoder->last_edge_us};
}

// Speed from the remembered edges, without sign; 0 while there is only one.
static int16_t speed_from_marks(const struct encoder *encoder)
{
    if (encoder->mark_count < 2)
        return 0;
    const struct encoder_mark *newest = &encoder->marks[0];
    uint16_t counts = 0;
    uint32_t us = 0;
    for (uint8_t i = 1; i < encoder->mark_count; i++) {
        uint16_t moved = (uint16_t)(newest->count - encoder->marks[i].count);
        if (encoder->direction < 0)
            moved = (uint16_t)-moved;
        counts = moved;
        us = newest->us - encoder->marks[i].us;
        if (moved % 4 == 0)
            break;
    }
    return speed_of(encoder, counts, us);
}

// The interrupt's 16-bit time as a 32-bit one. The edge may be slightly later than now_us.
static uint32_t widen_stamp(uint16_t stamp, uint32_t now_us)
{
    int16_t age = (int16_t)(uint16_t)((uint16_t)(now_us / ENCODER_STAMP_US) - stamp);
    return now_us - now_us % ENCODER_STAMP_US - (uint32_t)((int32_t)age * ENCODER_STAMP_US);
}

// Once an edge is too old for 32 bits its age stays "never", lest it become young again.
static uint32_t age_of_edge(const struct encoder *encoder, bool edge, uint32_t now_us)
{
    if (!edge && encoder->edge_age_us == ENCODER_NO_EDGE_US)
        return ENCODER_NO_EDGE_US;
    uint32_t age = now_us - encoder->last_edge_us;
    if (age <= INT32_MAX)
        return age;
    return edge ? 0 : ENCODER_NO_EDGE_US; // an edge may come between reading the clock and the counts
}

void encoder_update(struct encoder *encoder, const struct encoder_edges *edges, uint32_t now_us)
{
    uint8_t faults = (uint8_t)(edges->illegal - encoder->seen.illegal);
    int8_t moved = (int8_t)(uint8_t)(edges->count - encoder->seen.count);
    bool edge = moved != 0 || edges->stamp != encoder->seen.stamp
             || edges->direction != encoder->seen.direction;
    bool turned = edges->direction != encoder->direction || moved * edges->direction <= 0;
    encoder->seen = *edges;

    if (faults != 0) {
        encoder->illegal = (uint16_t)(encoder->illegal + faults);
        encoder->mark_count = 0; // the phases before and after no longer belong together
    }
    if (edge) {
        if (turned)
            encoder->mark_count = 0;
        encoder->count += moved;
        encoder->direction = edges->direction;
        encoder->last_edge_us = widen_stamp(edges->stamp, now_us);
        push_mark(encoder);
    }

    encoder->edge_age_us = age_of_edge(encoder, edge, now_us);
    if (encoder->edge_age_us >= ENCODER_STILL_US)
        encoder->mark_count = 0;

    int16_t speed = speed_from_marks(encoder);
    int16_t bound = speed_of(encoder, 3, 2 * encoder->edge_age_us);
    if (speed > bound)
        speed = bound;
    encoder->speed_q4 = encoder->direction < 0 ? (int16_t)-speed : speed;
}

// Requests, done exactly once: which was the last, and what became of it.
//
// A host numbers its requests and repeats each until telemetry shows its number. The number decides: the last
// one taken again is a repetition, and nothing is done for it; one before it is too old; any other is new. While
// the last one still runs no other is taken, lest what becomes of it never be told. Otherwise a new one is taken
// whatever comes of it, and what came of the one before is no longer told.
#ifndef REQUESTS_H
#define REQUESTS_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "messages.h" // enum outcome, enum refusal, ids of messages

struct requests {
    uint16_t last;   // number of the last one taken, 0 before the first
    uint8_t outcome; // enum outcome: what became of it
    uint8_t reason;  // enum refusal: why it was refused or ended early
    uint8_t running; // id of its message while its outcome is open, else 0
};

static inline bool requests_repeats(const struct requests *requests, uint16_t number)
{
    return number == requests->last;
}

// Why it is not taken: REFUSED_OLD_REQUEST, REFUSED_BUSY, or 0.
static inline uint8_t requests_refusal(const struct requests *requests, uint16_t number)
{
    if ((int16_t)(uint16_t)(number - requests->last) < 0)
        return REFUSED_OLD_REQUEST;
    return requests->running != 0 && !requests_repeats(requests, number) ? REFUSED_BUSY : 0;
}

// Take a new one: refused when there is a refusal; running until requests_end() when `runs`; else done.
// Returns the refusal.
uint8_t requests_take(struct requests *requests, uint8_t message, uint16_t number, uint8_t refusal,
                      bool runs);

// What ran under this message's id is over. Nothing, if none runs under it.
void requests_end(struct requests *requests, uint8_t message, uint8_t outcome, uint8_t reason);

#endif

// A bad line between a host and link.c: every small number of flipped bits, and corruptions of every kind at
// random. Counts what comes out that nobody sent.
#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width
#include <string.h>  // memcmp, memcpy, memmove, memset

#include "link.h" // what is under test

// --- What link.c hands on ----------------------------------------------------------------------------

struct heard {
    uint8_t id, seq;
    uint8_t payload[LINK_RAW_MAX_TO_ROBOT];
};

static struct heard heard[16]; // more than a line of two frames can hold
static unsigned heard_count;
static struct link ear;

static void hear(void *context, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    (void)context;
    struct heard *one = &heard[heard_count++ % 16];
    memset(one, 0, sizeof *one);
    one->id = id;
    one->seq = seq;
    memcpy(one->payload, payload, msg_to_robot_size(id));
}

// A link that has heard nothing yet, which takes any sequence number, receives `bytes` and a delimiter.
static void receive_alone(const uint8_t *bytes, unsigned size)
{
    link_init(&ear, hear, NULL, NULL);
    heard_count = 0;
    for (unsigned i = 0; i < size; i++)
        link_receive_byte(&ear, bytes[i]);
    link_receive_byte(&ear, 0);
}

// --- One to three flipped bits -----------------------------------------------------------------------

static void flip(uint8_t *bytes, unsigned bit)
{
    bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
}

static unsigned executed(const uint8_t *bytes, unsigned size, uint32_t *tried)
{
    receive_alone(bytes, size);
    ++*tried;
    return heard_count;
}

// Receive `bytes` with every choice of one, two and three of its bits flipped; returns how many messages came
// of it in `*tried` attempts.
uint32_t corrupt_flip_bits(uint8_t *bytes, uint32_t size, uint32_t *tried)
{
    uint32_t bits = 8 * size, messages = 0;
    *tried = 0;
    for (uint32_t a = 0; a < bits; a++) {
        flip(bytes, a);
        messages += executed(bytes, size, tried);
        for (uint32_t b = a + 1; b < bits; b++) {
            flip(bytes, b);
            messages += executed(bytes, size, tried);
            for (uint32_t c = b + 1; c < bits; c++) {
                flip(bytes, c);
                messages += executed(bytes, size, tried);
                flip(bytes, c);
            }
            flip(bytes, b);
        }
        flip(bytes, a);
    }
    return messages;
}

// --- Anything at random ------------------------------------------------------------------------------

#define LINE_MAX 128u

struct line {
    uint8_t bytes[LINE_MAX];
    unsigned size;
};

static uint64_t random_state;

static uint32_t random_below(uint32_t limit)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 7;
    random_state ^= random_state << 17;
    return (uint32_t)((random_state >> 32) % limit);
}

static void remove_bytes(struct line *line, unsigned at, unsigned count)
{
    memmove(line->bytes + at, line->bytes + at + count, line->size - at - count);
    line->size -= count;
}

static void insert_byte(struct line *line, unsigned at, uint8_t byte)
{
    if (line->size == LINE_MAX)
        return;
    memmove(line->bytes + at + 1, line->bytes + at, line->size - at);
    line->bytes[at] = byte;
    line->size++;
}

// One wound; `joint` is about where the second frame begins.
static void wound(struct line *line, unsigned joint)
{
    if (line->size < 2)
        return;
    unsigned at = random_below(line->size), left = line->size - at;
    switch (random_below(10)) {
    case 0: // a flipped bit
        flip(line->bytes, 8 * at + random_below(8));
        break;
    case 1: // another byte
        line->bytes[at] = (uint8_t)random_below(256);
        break;
    case 2: // a delimiter in the middle, or none where one was
        line->bytes[at] = line->bytes[at] ? 0 : 1;
        break;
    case 3: // doubled
        insert_byte(line, at, line->bytes[at]);
        break;
    case 4: // a byte too many
        insert_byte(line, at, (uint8_t)random_below(256));
        break;
    case 5: // lost
        remove_bytes(line, at, 1);
        break;
    case 6: // a burst of up to 8 bytes
        for (unsigned i = 0, length = 1 + random_below(8); i < length && i < left; i++)
            line->bytes[at + i] = (uint8_t)random_below(256);
        break;
    case 7: // the end is missing
        line->size = at;
        break;
    case 8: { // two frames spliced: from within the first to within the second
        unsigned from = joint < line->size ? random_below(joint + 1) : at;
        unsigned to = from + random_below(line->size - from);
        remove_bytes(line, from, to - from);
        break;
    }
    default: // two bytes swapped
        if (left > 1) {
            uint8_t byte = line->bytes[at];
            line->bytes[at] = line->bytes[at + 1];
            line->bytes[at + 1] = byte;
        }
    }
}

static bool is(const struct heard *one, const struct heard *sent)
{
    return one->id == sent->id && one->seq == sent->seq &&
           memcmp(one->payload, sent->payload, sizeof one->payload) == 0;
}

// Send `count` lines of two frames each with one to four wounds. The frames are drawn from `pool`, `frames` of
// them, each of `stride` bytes of which the first is its size. Returns how many messages came out that neither
// frame holds, or a third one; *untouched counts the lines from which both came whole, *lost those from which
// none did.
uint32_t corrupt_at_random(const uint8_t *pool, uint32_t frames, uint32_t stride, uint32_t count, uint64_t seed,
                           uint32_t *untouched, uint32_t *lost)
{
    uint32_t wrong = 0;
    random_state = seed;
    *untouched = *lost = 0;
    for (uint32_t n = 0; n < count; n++) {
        struct line line = {.size = 0};
        struct heard sent[2];
        unsigned joint = 0;
        for (unsigned i = 0; i < 2; i++) {
            const uint8_t *frame = pool + stride * random_below(frames);
            receive_alone(frame + 1, frame[0]);
            sent[i] = heard[0];
            joint = line.size;
            memcpy(line.bytes + line.size, frame + 1, frame[0]);
            line.size += frame[0];
        }
        for (unsigned wounds = 1 + random_below(4); wounds > 0; wounds--)
            wound(&line, joint);
        receive_alone(line.bytes, line.size);
        for (unsigned i = 0; i < heard_count; i++)
            wrong += i >= 2 || !(is(&heard[i], &sent[0]) || is(&heard[i], &sent[1]));
        *untouched += heard_count == 2;
        *lost += heard_count == 0;
    }
    return wrong;
}

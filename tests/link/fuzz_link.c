// Any bytes into link.c, and what must hold whatever they are. Built with clang -fsanitize=fuzzer.
#include <stdbool.h> // bool
#include <stddef.h>  // size_t
#include <stdint.h>  // integers of known width
#include <stdlib.h>  // abort
#include <string.h>  // memcpy

#include "host_coded.h" // frames of raw bytes
#include "link.h"       // what is under test

#define REQUIRE(truth) ((truth) ? (void)0 : abort())

// --- Looking at the link -----------------------------------------------------------------------------

static unsigned messages;
static uint32_t payload_sum; // every payload byte is read, so that the sanitizers see what is readable

static void handle(void *context, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    const struct link *link = context;
    uint8_t size = msg_to_robot_size(id);
    REQUIRE(size != MSG_UNKNOWN);
    REQUIRE(size + LINK_OVERHEAD == link->length);
    REQUIRE(link->frame[1] == seq);
    for (uint8_t i = 0; i < size; i++)
        payload_sum += payload[i];
    messages++;
}

static unsigned wire_size;

static void sink(void *context, uint8_t byte)
{
    (void)context;
    (void)byte;
    wire_size++;
}

// --- One input: everything a host might send ---------------------------------------------------------

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct link link;
    unsigned frames = 0; // not empty, and ended
    bool begun = false;
    link_init(&link, handle, sink, &link);
    messages = 0;
    for (size_t i = 0; i < size; i++) {
        unsigned before = messages;
        link_receive_byte(&link, data[i]);
        REQUIRE(messages <= before + (data[i] == 0)); // at the delimiter alone, and one at most
        frames += data[i] == 0 && begun;
        begun = data[i] != 0;
        if (begun)
            REQUIRE(link.begun);
    }
    const struct msg_link_status *counters = &link.counters;
    unsigned whole = counters->frames;
    REQUIRE(frames > 60000 ||
            whole + counters->crc + counters->framing + counters->overlong == frames); // each counted once
    REQUIRE(messages + counters->unknown + counters->length <= whole);
    // What is not handed on was unknown, of another length or out of turn; an ESTOP is both out of turn and
    // handed on.
    REQUIRE(messages + counters->unknown + counters->length + counters->stale >= whole);

    // The same bytes as a payload to send.
    wire_size = 0;
    uint8_t length = (uint8_t)(size < 255 ? size : 255);
    bool sent = link_send(&link, MSG_TELEMETRY, data, length, LINK_WIRE_MAX);
    REQUIRE(sent == (length + LINK_OVERHEAD <= LINK_RAW_MAX_TO_HOST));
    REQUIRE(wire_size == (sent ? length + LINK_OVERHEAD + 2u : 0u));
    return 0;
}

// --- Mutations that get past the checksum ------------------------------------------------------------

size_t LLVMFuzzerMutate(uint8_t *data, size_t size, size_t max_size);
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed);

#define BODY_MAX 60u

// What the blocks of a coded frame stand for, as far as they go.
static size_t uncoded(const uint8_t *coded, size_t size, uint8_t *raw)
{
    size_t length = 0;
    for (size_t at = 0; at < size && length < BODY_MAX;) {
        size_t end = at + coded[at];
        for (at++; at < end && at < size && length < BODY_MAX; at++)
            raw[length++] = coded[at];
        if (at < size && length < BODY_MAX)
            raw[length++] = 0;
    }
    return length;
}

// Half of the time every frame gets the checksum that belongs to what it has become.
size_t LLVMFuzzerCustomMutator(uint8_t *data, size_t size, size_t max_size, unsigned seed)
{
    size = LLVMFuzzerMutate(data, size, max_size);
    if (seed % 2)
        return size;
    uint8_t out[4096];
    size_t out_size = 0;
    for (size_t from = 0, i = 0; i < size; i++) {
        if (data[i] != 0)
            continue;
        uint8_t raw[BODY_MAX + 4];
        size_t length = uncoded(data + from, i - from, raw);
        length = length > 4 ? length - 4 : length; // the old checksum
        from = i + 1;
        if (length == 0 || out_size + length + 8 > sizeof out)
            continue;
        msg_put_u32(raw + length, link_crc32c(raw, (uint8_t)length));
        out_size += host_coded(out + out_size, raw, (unsigned)length + 4);
    }
    if (out_size == 0 || out_size > max_size)
        return size;
    memcpy(data, out, out_size);
    return out_size;
}

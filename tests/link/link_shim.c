// link.c and messages.h as a shared library: one link whose messages and bytes can be read from Python.
#include <string.h> // memcpy, memset

#include "link.h" // what is under test

static struct link link;
static uint8_t *received; // each message as id, sequence number, payload size, payload
static uint32_t received_size, received_capacity;
static uint8_t wire[LINK_WIRE_MAX];
static uint16_t wire_size;

static void handle(void *context, uint8_t id, uint8_t seq, const uint8_t *payload)
{
    (void)context;
    uint8_t size = msg_to_robot_size(id);
    if (received_size + 3u + size > received_capacity)
        return;
    received[received_size++] = id;
    received[received_size++] = seq;
    received[received_size++] = size;
    memcpy(received + received_size, payload, size);
    received_size += size;
}

static void sink(void *context, uint8_t byte)
{
    (void)context;
    wire[wire_size++] = byte;
}

static void begin_log(uint8_t *log, uint32_t capacity)
{
    received = log;
    received_capacity = capacity;
    received_size = 0;
}

void shim_init(void)
{
    link_init(&link, handle, sink, NULL);
}

uint32_t shim_receive(const uint8_t *bytes, uint32_t size, uint8_t *log, uint32_t log_capacity)
{
    begin_log(log, log_capacity);
    for (uint32_t i = 0; i < size; i++)
        link_receive_byte(&link, bytes[i]);
    return received_size;
}

void shim_counters(uint8_t *payload)
{
    msg_link_status_encode(&link.counters, payload);
}

uint16_t shim_send(uint8_t id, uint8_t seq, const uint8_t *payload, uint8_t size, uint8_t *bytes)
{
    wire_size = 0;
    link.seq_next = seq;
    link_send(&link, id, payload, size, sizeof wire);
    memcpy(bytes, wire, wire_size);
    return wire_size;
}

// A fresh link receives `bytes` and a delimiter; what comes out is added to the log.
static void receive_alone(const uint8_t *bytes, uint32_t size)
{
    link_init(&link, handle, sink, NULL);
    for (uint32_t i = 0; i < size; i++)
        link_receive_byte(&link, bytes[i]);
    link_receive_byte(&link, 0);
}

static void flip(uint8_t *bytes, uint32_t bit)
{
    bytes[bit / 8] ^= (uint8_t)(1u << bit % 8);
}

// Receive `bytes` with every choice of one, two and three of its bits flipped; returns how many of the
// `*tried` attempts brought any message.
uint32_t shim_flip_bits(uint8_t *bytes, uint32_t size, uint32_t *tried)
{
    uint8_t log[64];
    uint32_t bits = 8 * size, accepted = 0;
    *tried = 0;
    for (uint32_t a = 0; a < bits; a++)
        for (uint32_t b = a; b < bits; b++)
            for (uint32_t c = b; c < bits; c++) {
                if (a == b && b != c)
                    continue; // a == b == c is one flip, b == c two, else three
                begin_log(log, sizeof log);
                flip(bytes, a);
                if (b != a)
                    flip(bytes, b);
                if (c != b)
                    flip(bytes, c);
                receive_alone(bytes, size);
                flip(bytes, a);
                if (b != a)
                    flip(bytes, b);
                if (c != b)
                    flip(bytes, c);
                accepted += received_size > 0;
                ++*tried;
            }
    return accepted;
}

static uint32_t next_random(uint32_t *seed)
{
    *seed ^= *seed << 13;
    *seed ^= *seed >> 17;
    *seed ^= *seed << 5;
    return *seed;
}

// Overwrite, flip, double or lose one byte; returns the new size.
static uint32_t wound(uint8_t *bytes, uint32_t size, uint32_t random)
{
    uint32_t at = (random >> 8 & 0xFFFF) % size;
    switch (random >> 30) {
    case 0:
        bytes[at] = (uint8_t)random;
        return size;
    case 1:
        flip(bytes, 8 * at + (random & 7));
        return size;
    case 2:
        memmove(bytes + at + 1, bytes + at, size - at);
        return size + 1;
    default:
        memmove(bytes + at, bytes + at + 1, size - at - 1);
        return size > 1 ? size - 1 : size;
    }
}

// Receive `bytes`, one frame, with `count` random corruptions of one to four wounds each; returns how many
// brought another message than the frame holds. `*whole` counts those that brought that very message, as
// when the delimiter was doubled.
uint32_t shim_corrupt(const uint8_t *bytes, uint32_t size, uint32_t count, uint32_t seed, uint32_t *whole)
{
    uint8_t expected[64], log[64];
    uint32_t wrong = 0;
    begin_log(expected, sizeof expected);
    receive_alone(bytes, size);
    uint32_t expected_size = received_size;
    *whole = 0;
    for (uint32_t n = 0; n < count; n++) {
        uint8_t bad[LINK_WIRE_MAX + 4];
        uint32_t bad_size = size;
        memcpy(bad, bytes, size);
        for (uint32_t wounds = 1 + n % 4; wounds > 0; wounds--)
            bad_size = wound(bad, bad_size, next_random(&seed));
        begin_log(log, sizeof log);
        receive_alone(bad, bad_size);
        if (received_size == expected_size && memcmp(log, expected, expected_size) == 0)
            ++*whole;
        else if (received_size > 0)
            wrong++;
    }
    return wrong;
}

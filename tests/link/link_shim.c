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

// The robot's end of the serial link: bytes in, messages out; messages in, bytes out.
//
// A frame is COBS(id, sequence number, payload, CRC-32C) followed by 0x00; docs/protocol.md says the rest.
// Received bytes go to link_receive_byte() one by one, in the main loop, never in an interrupt. When a byte
// completes a frame that is whole, correct, known and in its turn, the handler is called from within that
// call. Everything else is dropped and counted, and the next delimiter starts afresh: noise costs the frame
// it hits and no other.
//
// Order: a frame repeated or overtaken by a later one is dropped, so that no old setpoint comes back to life.
// MSG_ESTOP is handed on all the same, and MSG_HELLO_REQUEST starts a new sequence.
//
// Memory: one struct, nothing else. Time per byte is bounded; the last byte of a frame costs a checksum of at
// most LINK_RAW_MAX_TO_ROBOT bytes, about 1800 cycles on an ATmega328P. No call may interrupt another one on
// the same struct.
#ifndef LINK_H
#define LINK_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

#include "messages.h" // sizes and ids of the messages, struct msg_link_status

// Most bytes on the wire for one message of link_send(), delimiter included.
#define LINK_WIRE_MAX (LINK_RAW_MAX_TO_HOST + 2u)

// Called for every message received. `payload` holds the bytes that belong to `id` (msg_..._decode() reads
// them) and is valid during the call only.
typedef void (*link_handler)(void *context, uint8_t id, uint8_t seq, const uint8_t *payload);

// Takes one byte to the wire; link_send() has made sure that there is room.
typedef void (*link_sink)(void *context, uint8_t byte);

struct link {
    // Every kind of loss, ready to be sent as MSG_LINK_STATUS. messages.h says what each one counts.
    // All are kept here except rx_overrun, which belongs to whoever holds the receive buffer.
    struct msg_link_status counters;

    link_handler handler;
    link_sink sink;
    void *context; // of both

    // Receiving
    uint8_t length;     // bytes in `frame`, or LINK_OVERLONG
    uint8_t block_left; // bytes until the next COBS code
    bool begun;         // a byte has come since the last delimiter
    bool seq_known;     // `seq_newest` holds one
    uint8_t seq_newest; // latest sequence number received

    uint8_t seq_next; // of the next message sent

    uint8_t frame[LINK_RAW_MAX_TO_ROBOT]; // decoded so far
};

// Everything zero, nothing received yet; sequence numbers start at 0.
void link_init(struct link *link, link_handler handler, link_sink sink, void *context);

// Take one received byte; may call the handler once.
void link_receive_byte(struct link *link, uint8_t byte);

// Send one message of `size` payload bytes, at most LINK_RAW_MAX_TO_HOST - LINK_OVERHEAD of them.
// `room` is how many bytes the sink can take now. A message that does not fit is not begun: tx_dropped counts
// it, its sequence number is used up so that the host sees the gap, and the result is false.
bool link_send(struct link *link, uint8_t id, const uint8_t *payload, uint8_t size, uint16_t room);

// CRC-32C (Castagnoli) of `size` bytes.
uint32_t link_crc32c(const uint8_t *data, uint8_t size);

#endif

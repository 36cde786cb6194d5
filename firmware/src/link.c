// Frames on the serial line: streaming COBS, CRC-32C, sequence numbers. See link.h.
#include "link.h" // what this file provides

#include <string.h> // memset, memcpy

// Length of a frame that did not fit; it is dropped at its delimiter.
#define LINK_OVERLONG 0xFFu

// Constant tables stay in flash on the AVR, where RAM is scarce.
#ifdef __AVR__
#define LINK_FLASH __flash
#else
#define LINK_FLASH
#endif

// --- Checksum --------------------------------------------------------------------------------------

// What the low and the high nibble of a byte contribute. Together they do what a table of 256 would, in 128 bytes
// of flash; and shifting by whole bytes is cheap on an 8-bit processor, where shifting by four bits is not.
static const LINK_FLASH uint32_t crc_of_low_nibble[16] = {
    0x00000000, 0xF26B8303, 0xE13B70F7, 0x1350F3F4, 0xC79A971F, 0x35F1141C, 0x26A1E7E8, 0xD4CA64EB,
    0x8AD958CF, 0x78B2DBCC, 0x6BE22838, 0x9989AB3B, 0x4D43CFD0, 0xBF284CD3, 0xAC78BF27, 0x5E133C24,
};
static const LINK_FLASH uint32_t crc_of_high_nibble[16] = {
    0x00000000, 0x105EC76F, 0x20BD8EDE, 0x30E349B1, 0x417B1DBC, 0x5125DAD3, 0x61C69362, 0x7198540D,
    0x82F63B78, 0x92A8FC17, 0xA24BB5A6, 0xB21572C9, 0xC38D26C4, 0xD3D3E1AB, 0xE330A81A, 0xF36E6F75,
};

uint32_t link_crc32c(const uint8_t *data, uint8_t size)
{
    uint32_t crc = 0xFFFFFFFF;
    for (uint8_t i = 0; i < size; i++) {
        uint8_t index = (uint8_t)crc ^ data[i];
        crc = crc >> 8 ^ crc_of_low_nibble[index & 0x0F] ^ crc_of_high_nibble[index >> 4];
    }
    return ~crc;
}

// --- Receiving -------------------------------------------------------------------------------------

static void append(struct link *link, uint8_t byte)
{
    if (link->length >= LINK_RAW_MAX_TO_ROBOT)
        link->length = LINK_OVERLONG;
    else
        link->frame[link->length++] = byte;
}

// Follow the sequence numbers; false for what is repeated or was overtaken.
static bool in_turn(struct link *link, uint8_t id, uint8_t seq)
{
    if (!link->seq_known || id == MSG_HELLO_REQUEST) {
        link->seq_known = true; // a session starts here: nothing before it can be missing
        link->seq_newest = seq;
        return true;
    }
    if ((uint8_t)(link->seq_newest - seq) < LINK_STALE_WINDOW) {
        link->counters.stale++;
        return id == MSG_ESTOP; // honoured in any order
    }
    link->counters.lost = (uint16_t)(link->counters.lost + (uint8_t)(seq - link->seq_newest - 1));
    link->seq_newest = seq;
    return true;
}

static void end_of_frame(struct link *link)
{
    struct msg_link_status *counters = &link->counters;
    if (link->length == LINK_OVERLONG) {
        counters->overlong++;
        return;
    }
    if (link->block_left != 0 || link->length < LINK_OVERHEAD) {
        counters->framing++;
        return;
    }
    uint8_t checked = (uint8_t)(link->length - 4u);
    if (link_crc32c(link->frame, checked) != msg_get_u32(link->frame + checked)) {
        counters->crc++;
        return;
    }
    counters->frames++;
    uint8_t id = link->frame[0];
    uint8_t seq = link->frame[1];
    bool accepted = in_turn(link, id, seq);
    uint8_t size = msg_to_robot_size(id);
    if (size == MSG_UNKNOWN)
        counters->unknown++;
    else if (size != link->length - LINK_OVERHEAD)
        counters->length++;
    else if (accepted)
        link->handler(link->context, id, seq, link->frame + 2);
}

void link_receive_byte(struct link *link, uint8_t byte)
{
    if (byte == 0) {
        if (link->begun) // empty frames are idle line
            end_of_frame(link);
        link->begun = false;
        link->length = 0;
        link->block_left = 0;
    } else if (link->block_left > 0) {
        link->block_left--;
        append(link, byte);
    } else {
        if (link->begun) // every block but the first stands for a zero
            append(link, 0);
        link->begun = true;
        link->block_left = (uint8_t)(byte - 1u);
    }
}

// --- Sending ---------------------------------------------------------------------------------------

// `raw` is short enough for COBS to need one extra byte, always.
static void send_cobs(struct link *link, const uint8_t *raw, uint8_t size)
{
    uint8_t at = 0;
    for (;;) {
        uint8_t end = at;
        while (end < size && raw[end] != 0)
            end++;
        link->sink(link->context, (uint8_t)(end - at + 1));
        while (at < end)
            link->sink(link->context, raw[at++]);
        if (end == size)
            break;
        at = (uint8_t)(end + 1u); // past the zero
    }
    link->sink(link->context, 0);
}

bool link_send(struct link *link, uint8_t id, const uint8_t *payload, uint8_t size, uint16_t room)
{
    uint8_t seq = link->seq_next++;
    uint8_t raw[LINK_RAW_MAX_TO_HOST];
    if (size > sizeof raw - LINK_OVERHEAD || room < size + LINK_OVERHEAD + 2u) {
        link->counters.tx_dropped++;
        return false;
    }
    raw[0] = id;
    raw[1] = seq;
    if (size > 0)
        memcpy(raw + 2, payload, size);
    uint8_t checked = (uint8_t)(size + 2u);
    msg_put_u32(raw + checked, link_crc32c(raw, checked));
    send_cobs(link, raw, (uint8_t)(checked + 4u));
    return true;
}

// --- Start -----------------------------------------------------------------------------------------

void link_init(struct link *link, link_handler handler, link_sink sink, void *context)
{
    memset(link, 0, sizeof *link);
    link->handler = handler;
    link->sink = sink;
    link->context = context;
}

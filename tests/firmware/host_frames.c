// The host's end of the line for C tests. See host_frames.h.
#include "host_frames.h" // what this file provides

#include "host_coded.h" // frames of raw bytes

unsigned host_frame(uint8_t *wire, uint8_t id, uint8_t seq, const uint8_t *payload, uint8_t size)
{
    uint8_t raw[64] = {id, seq};
    for (uint8_t i = 0; i < size; i++)
        raw[2 + i] = payload[i];
    msg_put_u32(raw + 2 + size, link_crc32c(raw, (uint8_t)(2 + size)));
    return host_coded(wire, raw, size + LINK_OVERHEAD);
}

void host_tell(struct robot *robot, uint32_t now_us, uint8_t id, uint8_t seq, const uint8_t *payload,
               uint8_t size)
{
    uint8_t wire[80];
    unsigned length = host_frame(wire, id, seq, payload, size);
    for (unsigned i = 0; i < length; i++)
        robot_receive_byte(robot, wire[i], now_us);
}

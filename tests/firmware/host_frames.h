// The host's end of the line for C tests: frames to the robot, which link.c cannot make.
#ifndef HOST_FRAMES_H
#define HOST_FRAMES_H

#include "robot.h" // whom they are for

// The bytes of one frame with this sequence number; how many they are. `wire` takes 80.
unsigned host_frame(uint8_t *wire, uint8_t id, uint8_t seq, const uint8_t *payload, uint8_t size);

// Hand the robot one message, all its bytes at this time.
void host_tell(struct robot *robot, uint32_t now_us, uint8_t id, uint8_t seq, const uint8_t *payload,
               uint8_t size);

#endif

// Time: microseconds for the firmware, 4 us stamps for encoder edges, and the 5 ms tick.
//
// Timer 0 counts at clock/64, 4 us a count, and never stops; its overflows widen it. Timer 2 interrupts every
// millisecond, every fifth of which is a tick.
#ifndef AVR_CLOCK_H
#define AVR_CLOCK_H

#include <stdbool.h> // bool
#include <stdint.h>  // integers of known width

// Start both timers, at 0.
void clock_init(void);

// Microseconds since clock_init(), in steps of 4; wraps as a 32-bit number. Interrupts may be on.
uint32_t clock_us(void);

// A tick has become due since the last call. Ticks missed in between are gone.
bool clock_take_tick(void);

// One is due; does not take it.
bool clock_tick_due(void);

// Overflows of timer 0. Written by its interrupt alone; the encoder interrupt makes its stamps from it.
extern volatile uint32_t clock_overflows;

#endif

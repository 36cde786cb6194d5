// From reset to main, and back again: safe outputs, why the processor started, and the watchdog.
//
// hal_reset_cause() and hal_boot_nonce() are here. What happens before main() needs no call: the motors are
// off within microseconds of a reset, before variables have their values.
#ifndef AVR_RESET_H
#define AVR_RESET_H

// The watchdog resets the processor unless watchdog_feed() is called every 60 ms. A reset turns the motors off.
void watchdog_start(void);

// Call once a round of the main loop is known to have done all its work.
void watchdog_feed(void);

#endif

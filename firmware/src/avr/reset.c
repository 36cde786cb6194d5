// What runs before main(), the boot nonce, and the watchdog.
#include "reset.h" // this file's manual

#include <avr/io.h>  // MCUSR, RAMSTART, RAMEND
#include <avr/wdt.h> // watchdog

#include "../hal.h"      // what is answered here
#include "../messages.h" // enum reset_cause
#include "motors.h"      // motors_safe

// Kept from before the C start-up clears variables.
static uint8_t reset_flags __attribute__((section(".noinit")));
static uint32_t boot_nonce __attribute__((section(".noinit")));

// A fingerprint (FNV-1a) of all memory as it came up. After power-on its contents are partly chance; after any
// other reset they hold the last nonce, among much else, so that two starts in a row do not get the same.
static inline __attribute__((always_inline)) uint32_t fingerprint_memory(void)
{
    uint32_t hash = 2166136261u;
    for (const uint8_t *at = (const uint8_t *)RAMSTART; at != (const uint8_t *)(RAMEND + 1); at++)
        hash = (hash ^ *at) * 16777619u;
    return hash;
}

__attribute__((noinline)) static void reset_early(void)
{
    motors_safe();
    reset_flags = MCUSR;
    MCUSR = 0; // else the watchdog cannot be turned off
    wdt_disable();
    boot_nonce = fingerprint_memory();
}

// Run into, not called, once there is a stack and before variables have their values.
__attribute__((naked, used, section(".init3"))) void reset_first(void)
{
    __asm__ volatile("call %x0" : : "i"(reset_early));
}

uint8_t hal_reset_cause(struct hal *hal)
{
    (void)hal;
    if (reset_flags & (1u << WDRF))
        return RESET_WATCHDOG;
    if (reset_flags & (1u << PORF)) // sets BORF besides
        return RESET_POWER_ON;
    if (reset_flags & (1u << BORF))
        return RESET_BROWN_OUT;
    if (reset_flags & (1u << EXTRF))
        return RESET_EXTERNAL;
    return RESET_UNKNOWN; // a bootloader has cleared the flags
}

uint32_t hal_boot_nonce(struct hal *hal)
{
    (void)hal;
    return boot_nonce;
}

void watchdog_start(void)
{
    wdt_enable(WDTO_60MS);
}

void watchdog_feed(void)
{
    wdt_reset();
}

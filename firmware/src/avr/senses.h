// What the robot feels besides its wheels' edges: encoder levels, battery voltage, emergency stop button.
//
// hal_encoder_pins(), hal_battery_mv() and hal_estop_pressed() are here.
#ifndef AVR_SENSES_H
#define AVR_SENSES_H

// Pins as inputs, pulled up; one measurement of the battery made. Takes about 0.2 ms.
void senses_init(void);

#endif

"""The firmware's encoder, motor, drive and supervisor, callable from Python, under UBSan."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path
from typing import Any

import cffi

HERE = Path(__file__).parent
FIRMWARE = HERE.parents[1] / "firmware/src"
PARTS = ("encoder", "wheel", "motor", "drive", "move", "supervisor")

DECLARATIONS = """
    struct shim_encoder *shim_encoder_new(uint8_t pins, uint16_t um_per_count);
    void shim_encoder_edge(struct shim_encoder *, uint8_t pins, uint32_t now_us);
    void shim_encoder_update(struct shim_encoder *, uint32_t now_us);
    int32_t shim_encoder_count(struct shim_encoder *);
    uint16_t shim_encoder_illegal(struct shim_encoder *);
    int16_t shim_encoder_speed_q4(struct shim_encoder *);
    uint32_t shim_encoder_edge_age_us(struct shim_encoder *);

    struct motor *shim_motor_new(int16_t static_duty, int16_t velocity_q8, int16_t proportional_q8,
                                 int16_t integral_q12, int16_t integral_limit, int16_t duty_limit);
    int16_t motor_update(struct motor *, int16_t setpoint_q4, uint16_t battery_mv);
    void shim_motor_sense(struct motor *, struct shim_encoder *);
    void shim_motor_set_speed_q4(struct motor *, int16_t speed_q4);
    int32_t shim_motor_drift_q12(struct motor *);

    struct drive *shim_drive_new(int32_t track_um, int16_t speed_q4, int16_t step_q4);
    void drive_command(struct drive *, int16_t v_mm_s, int16_t omega_mrad_s);
    void drive_release(struct drive *);
    void drive_update(struct drive *);
    int16_t shim_drive_target_q4(struct drive *, uint8_t side);
    int16_t shim_drive_setpoint_q4(struct drive *, uint8_t side);

    struct supervisor *shim_supervisor_new(uint32_t boot_nonce, uint16_t battery_min_mv, uint8_t reset_cause);
    uint8_t supervisor_hello(struct supervisor *, uint8_t protocol_version, uint32_t schema_hash);
    uint8_t supervisor_drive(struct supervisor *, uint32_t now_us, uint32_t expires_us);
    uint8_t supervisor_move(struct supervisor *, uint32_t now_us, uint32_t expires_us);
    uint8_t supervisor_keep_alive(struct supervisor *, uint32_t now_us, uint32_t expires_us);
    void supervisor_move_ended(struct supervisor *);
    void supervisor_stop(struct supervisor *, uint8_t how);
    void supervisor_estop(struct supervisor *);
    uint8_t supervisor_clear(struct supervisor *, uint32_t boot_nonce);
    void shim_supervisor_tick(struct supervisor *, uint32_t now_us, uint16_t battery_mv,
                              uint8_t estop_pressed, uint8_t wheels_still, uint8_t wheels);
    uint8_t shim_supervisor_state(struct supervisor *);
    uint8_t shim_supervisor_fault(struct supervisor *);
    uint8_t shim_supervisor_may_run(struct supervisor *);
    uint8_t shim_supervisor_coasts(struct supervisor *);
    bool supervisor_stands(struct supervisor *);

    void free(void *);
"""


class FirmwareInC:
    """The firmware's parts. `new` makes one, which lives as long as Python holds it."""

    def __init__(self, build_folder: Path) -> None:
        library = build_folder / "libfirmware.so"
        flags = ["-std=gnu11", "-O1", "-g", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-shared", "-fPIC"]
        checks = ["-fsanitize=undefined", "-fno-sanitize-recover=all"]
        sources = [HERE / "firmware_shim.c", *(FIRMWARE / f"{part}.c" for part in PARTS)]
        compiler = os.environ.get("CC", "cc")
        subprocess.run([compiler, *flags, *checks, f"-I{FIRMWARE}", *sources, "-o", library], check=True)
        self._ffi = cffi.FFI()
        self._ffi.cdef(DECLARATIONS)
        self.c: Any = self._ffi.dlopen(str(library))

    def new(self, part: str, *arguments: int) -> Any:
        """An encoder, motor, drive or supervisor."""
        made = getattr(self.c, f"shim_{part}_new")(*arguments)
        return self._ffi.gc(made, self.c.free)

// Python's door to the simulated board; host/sim/board.py is its documented face.
#include <nanobind/nanobind.h>

#include "board.hpp"

namespace nb = nanobind;

NB_MODULE(_board, module)
{
    nb::class_<Board>(module, "Board")
        .def(
            "__init__",
            [](Board *board, uint64_t seed, uint16_t um_per_count, uint16_t track_mm) {
                robot_params params = robot_params_default;
                params.um_per_count = um_per_count;
                params.track_um = track_mm * 1000;
                new (board) Board(seed, params);
            },
            nb::arg("seed"), nb::arg("um_per_count"), nb::arg("track_mm"))
        .def("step", &Board::step)
        .def_prop_ro("time_us", &Board::time_us)
        .def("write",
             [](Board &board, nb::bytes bytes) { board.write({bytes.c_str(), bytes.size()}); })
        .def("read",
             [](Board &board) {
                 std::string bytes = board.read();
                 return nb::bytes(bytes.data(), bytes.size());
             })
        .def("set_encoder_pins", &Board::set_encoder_pins)
        .def("duty", &Board::duty)
        .def("set_battery_mv", &Board::set_battery_mv)
        .def("press_estop", &Board::press_estop)
        .def("reset", &Board::reset)
        .def("hang", &Board::hang);
    module.attr("DUTY_FULL") = static_cast<int>(MOTOR_DUTY_FULL);
}

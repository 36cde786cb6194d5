// Python's door to the simulated board; host/sim/board.py is its documented face.
#include <nanobind/nanobind.h>

#include "board.hpp"

namespace nb = nanobind;

NB_MODULE(_board, module)
{
    nb::class_<Board>(module, "Board")
        .def(
            "__init__",
            [](Board *board, uint64_t seed, nb::bytes eeprom) {
                new (board) Board(seed, {eeprom.c_str(), eeprom.size()});
            },
            nb::arg("seed"), nb::arg("eeprom"))
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
        .def("coasting", &Board::coasting)
        .def_prop_ro("eeprom",
                     [](const Board &board) {
                         std::string_view held = board.eeprom();
                         return nb::bytes(held.data(), held.size());
                     })
        .def("set_battery_mv", &Board::set_battery_mv)
        .def("press_estop", &Board::press_estop)
        .def("reset", &Board::reset)
        .def("hang", &Board::hang);
    module.attr("EEPROM_BYTES") = std::tuple_size_v<decltype(hal::eeprom)>;
    module.attr("DUTY_FULL") = static_cast<int>(MOTOR_DUTY_FULL);
}

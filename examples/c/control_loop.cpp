// Control loop in C++ with limits, and commands for the anchor, the time constant and the amplitude of a rhythmic
// movement.
//
//     control_loop cycle.safetensors
//
// reproduces the first demonstration of a rhythmic model for three seconds, and prints a line per tick: status,
// position, velocity and acceleration, in hexadecimal notation, which is exact.

#include <cstdio>
#include <cstdlib>
#include <exception>
#include <vector>

#include "pdmp.hpp"

static void print(const std::vector<double> &numbers) {
    for (const double number : numbers) std::printf(" %a", number);
}

int main(int argc, char **argv) try {
    if (argc != 2) throw std::invalid_argument("usage: control_loop cycle.safetensors");
    const auto model = pdmp::Model::load(argv[1]);
    const auto conditions = model.demonstration(0);
    pdmp::Controller controller(model, 0.001, conditions);

    // Every tick keeps the limits of the robot: here 3 per second and 60 per second squared in each degree of freedom.
    const pdmp_status limited = controller.set_limits({{}, {}, {3.0}, {60.0}});
    if (limited < 0) throw pdmp::Error(limited, controller.error());

    auto anchor = conditions.anchor;
    for (double &centre : anchor) centre += 0.25;
    const double slower = 1.5 * model.info().tau, smaller = 0.5;

    pdmp_command command{};
    pdmp::Motion motion(model.info().n_dofs);
    for (int tick = 0; tick < 3000; ++tick) {
        if (tick == 1000) command.anchor = pdmp::view(anchor);
        if (tick == 2000) {
            command.tau = &slower;
            command.amplitude = &smaller;
        }
        const pdmp_status status = controller.update(command, motion);
        if (status < 0) throw pdmp::Error(status, controller.error());

        std::printf("%d", status);
        print(motion.position);
        print(motion.velocity);
        print(motion.acceleration);
        std::printf("\n");
    }
    return EXIT_SUCCESS;
} catch (const std::exception &error) {
    std::fprintf(stderr, "control_loop: %s\n", error.what());
    return EXIT_FAILURE;
}

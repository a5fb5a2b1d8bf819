// A control loop in C: the goal moves on the way, and for a moment somebody holds the robot.
//
//     control_loop reach.safetensors
//
// repeats the last demonstration of a discrete model and prints a line per tick: status, position, velocity and
// acceleration, in hexadecimal, which loses nothing.

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pdmp.h"

static int refused(const char *reason) {
    fprintf(stderr, "control_loop: %s\n", reason);
    return EXIT_FAILURE;
}

static void print(const double *numbers, size_t n) {
    for (size_t d = 0; d < n; ++d) printf(" %a", numbers[d]);
}

int main(int argc, char **argv) {
    if (argc != 2) return refused("usage: control_loop reach.safetensors");
    char reason[256];
    const pdmp_text error = {reason, sizeof reason};

    pdmp_model *model;
    if (pdmp_model_load(argv[1], &model, error) < 0) return refused(reason);
    pdmp_info info;
    pdmp_model_describe(model, &info);
    if (info.kind != PDMP_DISCRETE) return refused("the model has no goal");

    // All memory before the loop.
    const size_t n = info.n_dofs;
    double *numbers = calloc(info.n_conditions + 5 * n, sizeof *numbers);
    if (!numbers) return refused("no memory");
    double *position = numbers + info.n_conditions, *velocity = position + n, *acceleration = velocity + n;
    double *goal = acceleration + n, *robot = goal + n;

    pdmp_conditions conditions;
    const pdmp_buffer room = {numbers, info.n_conditions};
    if (pdmp_model_demonstration(model, info.n_demos - 1, &conditions, room, error) < 0) return refused(reason);
    const pdmp_settings settings = {.dt = 0.001};
    pdmp_controller *controller;
    if (pdmp_controller_new(model, &settings, &conditions, &controller, error) < 0) return refused(reason);
    pdmp_model_free(model);  // the controller keeps what it needs

    for (size_t d = 0; d < n; ++d) goal[d] = conditions.goal.data[d] + 0.125;
    pdmp_command command = {0};
    const pdmp_motion motion = {{position, n}, {velocity, n}, {acceleration, n}};
    pdmp_status status = PDMP_WORKING;
    for (int tick = 0; status == PDMP_WORKING; ++tick) {
        if (tick == 300) command.goal = (pdmp_vector){goal, n};
        const bool held = 500 <= tick && tick < 700;
        command.measured = held ? (pdmp_vector){robot, n} : (pdmp_vector){0};

        status = pdmp_controller_update(controller, &command, &motion);
        if (!held) memcpy(robot, position, n * sizeof *robot);

        printf("%d", status);
        print(position, n);
        print(velocity, n);
        print(acceleration, n);
        printf("\n");
    }
    if (status < 0) {
        pdmp_controller_error(controller, error);
        return refused(reason);
    }
    pdmp_controller_free(controller);
    free(numbers);
    return EXIT_SUCCESS;
}

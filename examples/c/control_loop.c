// Control loop in C with a new goal during the movement, and a robot that is blocked for 0.2 s.
//
//     control_loop reach.safetensors
//
// reproduces the last demonstration of a discrete model, and prints a line per tick: status, position, velocity and
// acceleration, in hexadecimal notation, which is exact.

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pdmp.h"

static int fail(const char *message) {
    fprintf(stderr, "control_loop: %s\n", message);
    return EXIT_FAILURE;
}

static void print(const double *numbers, size_t n) {
    for (size_t d = 0; d < n; ++d) printf(" %a", numbers[d]);
}

int main(int argc, char **argv) {
    if (argc != 2) return fail("usage: control_loop reach.safetensors");
    char message[256];
    const pdmp_text error = {message, sizeof message};

    pdmp_model *model;
    if (pdmp_model_load(argv[1], &model, error) < 0) return fail(message);
    pdmp_info info;
    pdmp_model_describe(model, &info);
    if (info.kind != PDMP_DISCRETE) return fail("the model is rhythmic: it has no goal");

    // The loop itself does not allocate.
    const size_t n = info.n_dofs;
    double *numbers = calloc(info.n_conditions + 5 * n, sizeof *numbers);
    if (!numbers) return fail("out of memory");
    double *position = numbers + info.n_conditions, *velocity = position + n, *acceleration = velocity + n;
    double *goal = acceleration + n, *robot = goal + n;

    pdmp_conditions conditions;
    const pdmp_buffer storage = {numbers, info.n_conditions};
    if (pdmp_model_demonstration(model, info.n_demos - 1, &conditions, storage, error) < 0) return fail(message);
    const pdmp_settings settings = {.dt = 0.001};
    pdmp_controller *controller;
    if (pdmp_controller_new(model, &settings, &conditions, &controller, error) < 0) return fail(message);
    pdmp_model_free(model);  // the controller does not need it

    for (size_t d = 0; d < n; ++d) goal[d] = conditions.goal.data[d] + 0.125;
    pdmp_command command = {0};
    const pdmp_motion motion = {{position, n}, {velocity, n}, {acceleration, n}};
    pdmp_status status = PDMP_WORKING;
    for (int tick = 0; status == PDMP_WORKING; ++tick) {
        if (tick == 300) command.goal = (pdmp_vector){goal, n};
        const bool blocked = 500 <= tick && tick < 700;
        command.measured = blocked ? (pdmp_vector){robot, n} : (pdmp_vector){0};

        status = pdmp_controller_update(controller, &command, &motion);
        if (!blocked) memcpy(robot, position, n * sizeof *robot);

        printf("%d", status);
        print(position, n);
        print(velocity, n);
        print(acceleration, n);
        printf("\n");
    }
    if (status < 0) {
        pdmp_controller_error(controller, error);
        return fail(message);
    }
    pdmp_controller_free(controller);
    free(numbers);
    return EXIT_SUCCESS;
}

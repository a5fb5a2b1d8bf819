// Recognises a movement from its first half, and follows the rest of it through a higher point.
//
//     recognition reach.safetensors
//
// takes a discrete model whose file keeps its prior. The movement is the last demonstration. Printed are the time of arrival and
// the goal that are estimated after each sample, the positions to come, and those of the controller, in hexadecimal notation,
// which is exact.

#include <stdio.h>
#include <stdlib.h>

#include "pdmp.h"

enum { N_SEEN = 50, N_AHEAD = 10, N_TICKS = 700 };

static int fail(const char *message) {
    fprintf(stderr, "recognition: %s\n", message);
    return EXIT_FAILURE;
}

static void print(const double *numbers, size_t n) {
    for (size_t d = 0; d < n; ++d) printf(" %a", numbers[d]);
}

int main(int argc, char **argv) {
    if (argc != 2) return fail("usage: recognition reach.safetensors");
    char message[256];
    const pdmp_text error = {message, sizeof message};

    // Model and prior come from one file.
    pdmp_model *model;
    pdmp_recogniser *recogniser;
    if (pdmp_model_load(argv[1], &model, error) < 0) return fail(message);
    const pdmp_vector no_context = {NULL, 0};
    if (pdmp_recogniser_load(argv[1], no_context, NULL, &recogniser, error) < 0) return fail(message);
    pdmp_info info;
    pdmp_model_describe(model, &info);
    if (info.kind != PDMP_DISCRETE) return fail("the model is rhythmic: it has no goal");

    const size_t n = info.n_dofs;
    double *seen = calloc(info.n_conditions + (N_SEEN + 2 * N_AHEAD + 1) * n, sizeof *seen);
    if (!seen) return fail("out of memory");
    double *ahead = seen + N_SEEN * n, *deviation = ahead + N_AHEAD * n, *position = deviation + N_AHEAD * n;
    const pdmp_buffer storage = {position + n, info.n_conditions};
    pdmp_conditions demonstrated;
    if (pdmp_model_demonstration(model, info.n_demos - 1, &demonstrated, storage, error) < 0) return fail(message);
    const pdmp_motion movement = {.position = {seen, N_SEEN * n}};
    if (pdmp_model_rollout(model, &demonstrated, 0.01, N_SEEN, &movement, error) < 0) return fail(message);

    // The loop does not allocate.
    pdmp_estimate estimate;
    double time = 0.0;
    for (int k = 0; k < N_SEEN; ++k) {
        time = 0.01 * k;
        if (pdmp_recogniser_update(recogniser, time, (pdmp_vector){seen + k * n, n}) < 0 ||
            pdmp_recogniser_estimate(recogniser, &estimate) < 0) {
            pdmp_recogniser_error(recogniser, error);
            return fail(message);
        }
        print(&estimate.arrival, 1);
        print(estimate.conditions.goal.data, n);
        printf("\n");
    }
    double times[N_AHEAD];
    for (int k = 0; k < N_AHEAD; ++k) times[k] = time + 0.02 * (k + 1);
    const pdmp_buffer outputs[] = {{ahead, N_AHEAD * n}, {deviation, N_AHEAD * n}};
    if (pdmp_recogniser_continuation(recogniser, (pdmp_vector){times, N_AHEAD}, outputs[0], outputs[1]) < 0) {
        pdmp_recogniser_error(recogniser, error);
        return fail(message);
    }
    for (int k = 0; k < N_AHEAD; ++k) {
        print(ahead + k * n, n);
        print(deviation + k * n, n);
        printf("\n");
    }

    // The estimated movement, but 0.05 higher in the second degree of freedom at the last of these times.
    if (pdmp_recogniser_estimate(recogniser, &estimate) < 0) return fail("no estimate");
    const double height = ahead[(N_AHEAD - 1) * n + 1] + 0.05;
    const size_t second = 1;
    const pdmp_point point = {.time = &times[N_AHEAD - 1], .position = {&height, 1}, .dofs = &second, .n_dofs = 1};
    pdmp_passage *passage;
    if (pdmp_model_through(model, &point, 1, &estimate.conditions, NULL, &passage, error) < 0) return fail(message);
    pdmp_passage_info through;
    pdmp_passage_describe(passage, &through);
    const pdmp_settings settings = {.dt = 0.001};
    pdmp_controller *controller;
    if (pdmp_controller_new(model, &settings, &through.conditions, &controller, error) < 0) return fail(message);
    pdmp_passage_free(passage);  // the controller does not need these
    pdmp_recogniser_free(recogniser);
    pdmp_model_free(model);

    const pdmp_motion motion = {.position = {position, n}};
    for (int tick = 0; tick < N_TICKS; ++tick) {
        if (pdmp_controller_update(controller, NULL, &motion) < 0) {
            pdmp_controller_error(controller, error);
            return fail(message);
        }
        print(position, n);
        printf("\n");
    }
    pdmp_controller_free(controller);
    free(seen);
    return EXIT_SUCCESS;
}

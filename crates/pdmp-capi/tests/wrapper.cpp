// Calls every member of pdmp.hpp on a discrete model of three DoFs, and prints the motion after each tick.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <utility>

#include "pdmp.hpp"

static void require(bool condition, int line) {
    if (!condition) throw std::logic_error("line " + std::to_string(line));
}

#define REQUIRE(condition) require(condition, __LINE__)

template <class Call>
static pdmp_status status_thrown_by(Call call) {
    try {
        call();
    } catch (const pdmp::Error &error) {
        REQUIRE(error.what()[0] != '\0');
        return error.status();
    }
    return PDMP_OK;
}

int main(int, char **argv) try {
    REQUIRE(status_thrown_by([] { pdmp::Model::load("absent"); }) == PDMP_IO);
    REQUIRE(status_thrown_by([] { pdmp::Model::from_bytes("damaged", 7); }) == PDMP_FILE);

    std::ifstream file(argv[1], std::ios::binary);
    const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
    auto model = pdmp::Model::from_bytes(bytes.data(), bytes.size());
    REQUIRE(model.info().n_dofs == 3 && model.info().kind == PDMP_DISCRETE);
    REQUIRE(model.name(0) == pdmp::Model::load(argv[1]).name(0) && model.name(3).empty());
    REQUIRE(model.label(0, 0).empty() && model.unit(2) == "m" && model.unit(3).empty());
    REQUIRE(status_thrown_by([&] { model.demonstration(5); }) == PDMP_RANGE);
    REQUIRE(status_thrown_by([&] { model.predict({}); }) == PDMP_NULL);
    REQUIRE(status_thrown_by([&] { model.rollout({}, 0.0, 10); }) == PDMP_RANGE);
    REQUIRE(status_thrown_by([&] { model.rollout({}, 0.01, 0); }) == PDMP_RANGE);

    auto conditions = model.predict({0.2});
    conditions.velocity = {0.0, 0.0, 0.0};
    pdmp::Controller first(model, 0.002, {}, 0.0);
    auto controller = std::move(first);
    model = pdmp::Model::load(argv[1]);
    REQUIRE(controller.error().empty());
    controller.reset(conditions);
    conditions.amplitude = 2.0;
    REQUIRE(status_thrown_by([&] { controller.reset(conditions); }) == PDMP_ABSENT);
    REQUIRE(status_thrown_by([&] { pdmp::Controller invalid(model, 0.0); }) == PDMP_RANGE);
    REQUIRE(first.step() == PDMP_NULL);

    pdmp::Motion motion(3);
    const std::array<double, 3> goal{0.75, 0.5, 0.25};
    const double measured[] = {0.5, 0.25, 0.0};
    const auto style = model.demonstration(0).style;
    const pdmp::Limits limits{{}, {1.0, 1.0, 1.0}, {0.25, 0.25, 0.25}, {5.0, 5.0, 5.0}, {100.0}};
    std::vector<pdmp_limit> limited(3);
    int n_limited = 0;
    for (int tick = 0; tick < 500; ++tick) {
        pdmp_command command{};
        if (tick == 100) REQUIRE(controller.set_style(pdmp::view(style)) == PDMP_OK);
        if (tick == 150) REQUIRE(controller.set_goal(pdmp::view(goal)) == PDMP_OK);
        if (tick == 200) REQUIRE(controller.set_tau(1.5) == PDMP_OK);
        if (tick == 220) REQUIRE(controller.set_tolerance(0.05) == PDMP_OK);
        if (tick == 230) REQUIRE(controller.set_limits(limits) == PDMP_OK);
        if (tick == 450) REQUIRE(controller.set_limits({}) == PDMP_OK);
        if (tick == 250) REQUIRE(controller.set_compliance(100.0, 5.0) == PDMP_OK);
        if (tick >= 300 && tick < 350) command.measured = pdmp::view(measured);
        if (tick >= 400) command.coupling = {pdmp::view(measured), pdmp::view(goal)};
        if (tick % 2 == 0) {
            REQUIRE(controller.update(command, motion) == PDMP_WORKING);
        } else {
            REQUIRE(controller.step() == PDMP_WORKING && controller.read(motion) == PDMP_WORKING);
        }
        REQUIRE(controller.limited(limited) == PDMP_WORKING);
        for (const auto limit : limited) n_limited += limit != PDMP_LIMIT_NONE;
        for (const auto *numbers : {&motion.position, &motion.velocity, &motion.acceleration})
            for (const double number : *numbers) std::printf("%a ", number);
        std::printf("\n");
    }
    REQUIRE(n_limited > 0);
    REQUIRE(controller.set_limits({{}, {}, {0.0}, {}}) == PDMP_RANGE);
    limited.resize(2);
    REQUIRE(controller.limited(limited) == PDMP_LENGTH);
    REQUIRE(controller.set_speed(1.0) == PDMP_OK && controller.release() == PDMP_OK);
    REQUIRE(controller.set_anchor(pdmp::view(goal)) == PDMP_ABSENT);
    REQUIRE(controller.set_phase(0.5) == PDMP_ABSENT && controller.set_phase_gain(2.0) == PDMP_OK);
    REQUIRE(controller.set_amplitude(0.5) == PDMP_ABSENT);
    REQUIRE(controller.error() == "amplitude does not apply to a discrete primitive");
    double time = 0.0, phase = 0.0;
    REQUIRE(controller.progress(&time, &phase) == PDMP_WORKING);
    REQUIRE(time > 0.999 && time < 1.001 && phase > 0.0 && phase < 1.0);

    auto copy = controller.clone();
    const auto forecast = controller.forecast(0.002, 101);
    REQUIRE(status_thrown_by([&] { controller.forecast(-1.0, 101); }) == PDMP_RANGE);
    pdmp::Motion ahead(3);
    for (int tick = 0; tick < 100; ++tick) REQUIRE(copy.step() > 0);
    REQUIRE(controller.read(motion) > 0 && copy.read(ahead) > 0 && motion.position != ahead.position);
    for (int tick = 0; tick < 100; ++tick) REQUIRE(controller.step() > 0);
    REQUIRE(controller.read(motion) > 0 && motion.position == ahead.position);
    REQUIRE(motion.velocity == ahead.velocity && motion.acceleration == ahead.acceleration);
    REQUIRE(std::equal(ahead.position.begin(), ahead.position.end(), forecast.position.end() - 3));
    REQUIRE(std::equal(ahead.acceleration.begin(), ahead.acceleration.end(), forecast.acceleration.end() - 3));
    for (int tick = 0; tick < 50; ++tick) REQUIRE(controller.step() > 0);
    REQUIRE(copy.copy_from(controller) == PDMP_OK && copy.copy_from(copy) == PDMP_OK);
    REQUIRE(controller.step() > 0 && copy.step() > 0 && controller.read(motion) > 0 && copy.read(ahead) > 0);
    REQUIRE(motion.position == ahead.position && motion.acceleration == ahead.acceleration);
    REQUIRE(copy.copy_from(first) == PDMP_NULL && first.copy_from(copy) == PDMP_NULL);
    REQUIRE(copy.error() == "controller is NULL");
    REQUIRE(status_thrown_by([&] { first.clone(); }) == PDMP_NULL);

    const pdmp::Pose left{0.5, 0.25, 0.25, 1.0, 0.0, 0.0, 0.0}, right{0.5, -0.25, 0.25, 0.0, 0.0, 0.0, 1.0};
    REQUIRE(status_thrown_by([&] { pdmp::TwoArms().absolute_relative(left, right); }) == PDMP_RANGE);
    const pdmp::TwoArms arms({0.0, 0.0, 0.0, 1.0});
    const auto [absolute, relative] = arms.absolute_relative(left, right);
    REQUIRE(absolute[0] == 0.5 && absolute[1] == 0.0 && relative[6] == 1.0);
    const auto again = arms.left_right(absolute, relative);
    for (int k = 0; k < 7; ++k) REQUIRE(std::abs(again[0][k] - left[k]) + std::abs(again[1][k] - right[k]) < 1e-15);

    pdmp::Point point;
    point.time = 0.4;
    point.position = {0.31};
    point.dofs = {1};
    const auto passage = model.through({point});
    REQUIRE(passage.n_constraints == 1 && passage.displacement.size() == 3 && passage.distance >= 0.0);
    REQUIRE(std::abs(model.rollout(passage.conditions, 0.01, 41).position[3 * 40 + 1] - 0.31) < 1e-9);
    pdmp::Controller passing(model, 0.002, passage.conditions);
    for (int tick = 0; tick < 100; ++tick) REQUIRE(passing.step() > 0);
    pdmp::PassageOptions options;
    double from = 0.0;
    REQUIRE(passing.progress(nullptr, &from) > 0);
    options.from_phase = from;
    point.time = 0.6;
    REQUIRE(passing.add_forcing(model.through({point}, passage.conditions, options)) == PDMP_OK);
    for (int tick = 0; tick < 200; ++tick) REQUIRE(passing.step() > 0);
    REQUIRE(passing.read(motion) > 0 && std::abs(motion.position[1] - 0.31) < 1e-6);
    REQUIRE(status_thrown_by([&] { model.through({}); }) == PDMP_NULL);
    REQUIRE(status_thrown_by([&] { model.through({pdmp::Point{}}); }) == PDMP_RANGE);

    pdmp::Timing timing;
    timing.latest = 0.1;
    auto recogniser = pdmp::Recogniser::from_bytes(bytes.data(), bytes.size(), timing);
    REQUIRE(status_thrown_by([&] { recogniser.conditions(); }) == PDMP_RANGE && !recogniser.error().empty());
    const auto movement = model.rollout(model.demonstration(2), 0.01, 60);
    const auto watch = [&](pdmp::Recogniser &own) {
        for (int k = 0; k < 60; ++k) {
            const pdmp_vector position{movement.position.data() + 3 * k, 3};
            REQUIRE(own.update(0.01 * k, position) == PDMP_OK);
        }
        return own.conditions();
    };
    const auto seen = watch(recogniser);
    REQUIRE(std::abs(seen.goal[0] - model.demonstration(2).goal[0]) < 0.05 && seen.tau && seen.start.size() == 3);
    pdmp_estimate estimate{};
    REQUIRE(recogniser.estimate(estimate) == PDMP_OK && estimate.fraction > 0.3 && estimate.goal_deviation.length == 3);
    const std::array<double, 2> times{0.7, 0.8};
    pdmp::Continuation ahead_of(2, 3, 3);
    REQUIRE(recogniser.continuation(pdmp::view(times), ahead_of) == PDMP_OK && ahead_of.deviation[5] > 0.0);
    REQUIRE(recogniser.reset() == PDMP_OK && watch(recogniser).goal == seen.goal);
    auto other = pdmp::Recogniser::load(argv[1]);
    pdmp::Controller following(model, 0.002, watch(other));
    auto given = pdmp::Recogniser::load(argv[1], {}, {0.2});
    REQUIRE(std::abs(watch(given).goal[0] - model.demonstration(2).goal[0]) < 0.05);
    REQUIRE(status_thrown_by([&] { pdmp::Recogniser::load(argv[1], {}, {0.2, 0.3}); }) == PDMP_LENGTH);
    REQUIRE(following.step() == PDMP_WORKING);

    const auto rollout = model.rollout(model.predict({0.2}), 0.01, 40);
    REQUIRE(rollout.velocity.size() == 120);
    for (int row = 0; row < 40; ++row) {
        for (const auto *numbers : {&rollout.position, &rollout.velocity, &rollout.acceleration})
            for (int dof = 0; dof < 3; ++dof) std::printf("%a ", (*numbers)[3 * row + dof]);
        std::printf("\n");
    }
    return 0;
} catch (const std::exception &error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
}

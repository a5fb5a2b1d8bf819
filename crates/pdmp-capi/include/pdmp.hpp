// C++17 wrapper of pdmp.h with RAII, std::vector and exceptions.
//
// Loading, prediction, construction and reset throw pdmp::Error. The functions of the control loop are noexcept and
// return a pdmp_status: negative values are errors, after which the controller is unchanged and Controller::error
// returns the message. So do those of a recogniser. Lengths, units, equations and thread safety are those of pdmp.h.

#ifndef PDMP_HPP
#define PDMP_HPP

#include <array>
#include <cstddef>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "pdmp.h"

namespace pdmp {

/// Error status and message of a call.
class Error : public std::runtime_error {
public:
    Error(pdmp_status status, const std::string &text) : std::runtime_error(text), status_(status) {}

    /// Returns the status, which is negative.
    pdmp_status status() const noexcept { return status_; }

private:
    pdmp_status status_;
};

/// Returns a non-owning view of a contiguous container of double, which must outlive the view.
template <class Numbers>
pdmp_vector view(const Numbers &numbers) noexcept {
    return {std::data(numbers), static_cast<std::size_t>(std::size(numbers))};
}

template <class Numbers>
pdmp_vector view(const Numbers &&) = delete;

/// Conditions of a movement, see pdmp_conditions. An empty member takes the value of the nominal demonstration.
struct Conditions {
    std::vector<double> style, goal, anchor, start, velocity, goal_velocity;
    std::optional<double> amplitude, tau, phase;
    /// Additional forcing of a movement through points, see Model::through; none if NULL.
    std::shared_ptr<const pdmp_passage> forcing{};
};

/// Point that a movement passes, see pdmp_point: at a time or a phase, with a position, a velocity or both. No `dofs` are all.
struct Point {
    std::optional<double> time, phase;
    std::vector<double> position{}, velocity{};
    std::vector<std::size_t> dofs{};
    double tolerance = 0.0;
};

/// Options of Model::through, see pdmp_passage_options. An empty member is not given.
struct PassageOptions {
    std::vector<double> context{};
    std::optional<double> from_phase{}, deviation{};
};

/// Movement through points, see pdmp_passage_info. The conditions and the controllers share the forcing.
struct Passage {
    Conditions conditions;
    std::shared_ptr<const pdmp_passage> forcing;
    double distance;
    std::size_t n_constraints;
    bool far;
    std::vector<double> displacement;
};

/// Knowledge of the time of a movement that is observed, see pdmp_timing.
struct Timing {
    double earliest = 0.0, latest = 0.0;
    std::optional<double> duration{};
};

/// Limits of position, velocity, acceleration and jerk, see pdmp_limits: one number for all degrees of freedom, or n_dofs. An
/// empty member is no limit.
struct Limits {
    std::vector<double> lower{}, upper{}, velocity{}, acceleration{}, jerk{};
    bool synchronous = true;
};

/// Motion with n_coordinates and n_dofs elements, see pdmp_motion.
struct Motion {
    /// Allocates the vectors for a model without rotations.
    explicit Motion(std::size_t n_dofs) : Motion(n_dofs, n_dofs) {}

    /// Allocates the vectors for a model, by its pdmp_info.
    explicit Motion(const pdmp_info &info) : Motion(info.n_coordinates, info.n_dofs) {}

    /// Allocates the vectors.
    Motion(std::size_t n_coordinates, std::size_t n_dofs)
        : position(n_coordinates), velocity(n_dofs), acceleration(n_dofs) {}

    std::vector<double> position, velocity, acceleration;
};

/// Sampled movement: n_samples rows of n_coordinates positions, and of n_dofs velocities and accelerations.
using Trajectory = Motion;

namespace detail {

/// Executes a call that writes an error message, and throws pdmp::Error if its status is negative.
template <class Call>
void check(Call call) {
    char text[512] = "";
    const pdmp_status status = call(pdmp_text{text, sizeof text});
    if (status < 0) throw Error(status, text);
}

inline pdmp_vector to_c(const std::vector<double> &numbers) noexcept {
    return numbers.empty() ? pdmp_vector{} : view(numbers);
}

inline const double *to_c(const std::optional<double> &number) noexcept { return number ? &*number : nullptr; }

inline pdmp_conditions to_c(const Conditions &c) noexcept {
    return {to_c(c.style),    to_c(c.goal),          to_c(c.anchor),    to_c(c.start),
            to_c(c.velocity), to_c(c.goal_velocity), to_c(c.amplitude), to_c(c.tau),
            to_c(c.phase),    c.forcing.get()};
}

inline pdmp_point to_c(const Point &point) noexcept {
    const std::size_t n = point.dofs.size();
    return {to_c(point.time), to_c(point.phase), to_c(point.position), to_c(point.velocity), n ? point.dofs.data() : nullptr, n,
            point.tolerance};
}

inline pdmp_limits to_c(const Limits &limits) noexcept {
    return {to_c(limits.lower), to_c(limits.upper), to_c(limits.velocity), to_c(limits.acceleration),
            to_c(limits.jerk), !limits.synchronous};
}

inline std::vector<double> copy(pdmp_vector numbers) { return {numbers.data, numbers.data + numbers.length}; }

inline std::optional<double> copy(const double *number) {
    return number ? std::optional<double>(*number) : std::nullopt;
}

/// Copies conditions without their forcing.
inline Conditions copy(const pdmp_conditions &c) {
    return {copy(c.style),    copy(c.goal),          copy(c.anchor),    copy(c.start), copy(c.velocity),
            copy(c.goal_velocity), copy(c.amplitude), copy(c.tau), copy(c.phase)};
}

inline pdmp_buffer buffer(std::vector<double> &numbers) noexcept { return {numbers.data(), numbers.size()}; }

inline pdmp_motion to_c(Motion &motion) noexcept {
    return {buffer(motion.position), buffer(motion.velocity), buffer(motion.acceleration)};
}

}  // namespace detail

/// Learnt primitive. It is immutable, and threads may share it.
class Model {
public:
    /// Loads a model file. `path` is a UTF-8 string.
    static Model load(const std::string &path) {
        return Model([&](pdmp_model **model, pdmp_text error) { return pdmp_model_load(path.c_str(), model, error); });
    }

    /// Loads a model from the `size` bytes of a model file in memory.
    static Model from_bytes(const void *bytes, std::size_t size) {
        return Model([&](pdmp_model **model, pdmp_text error) {
            return pdmp_model_from_bytes(bytes, size, model, error);
        });
    }

    /// Returns the properties of the model.
    pdmp_info info() const noexcept {
        pdmp_info info{};
        pdmp_model_describe(get(), &info);
        return info;
    }

    /// Returns the name of degree of freedom `dof`, counted from 0, or an empty string if `dof` >= n_dofs.
    std::string name(std::size_t dof) const {
        const char *name = pdmp_model_name(get(), dof);
        return name ? name : "";
    }

    /// Returns the unit of degree of freedom `dof`, counted from 0; empty if it is not known or `dof` >= n_dofs.
    std::string unit(std::size_t dof) const {
        const char *unit = pdmp_model_unit(get(), dof);
        return unit ? unit : "";
    }

    /// Returns label `label` of context column `column`, both counted from 0, or an empty string if there is none.
    std::string label(std::size_t column, std::size_t label) const {
        const char *text = pdmp_model_label(get(), column, label);
        return text ? text : "";
    }

    /// Returns the conditions that reproduce demonstration `demonstration`, counted from 0.
    Conditions demonstration(std::size_t demonstration) const {
        return conditions([&](pdmp_conditions *conditions, pdmp_buffer storage, pdmp_text error) {
            return pdmp_model_demonstration(get(), demonstration, conditions, storage, error);
        });
    }

    /// Predicts the conditions of a movement for a context (n_contexts).
    Conditions predict(const std::vector<double> &context) const {
        return conditions([&](pdmp_conditions *conditions, pdmp_buffer storage, pdmp_text error) {
            return pdmp_model_predict(get(), view(context), conditions, storage, error);
        });
    }

    /// Computes the movement at the times 0, dt, ..., (n_samples - 1) dt, see pdmp_model_rollout.
    Trajectory rollout(const Conditions &conditions, double dt, std::size_t n_samples) const {
        const pdmp_conditions c = detail::to_c(conditions);
        Trajectory trajectory(n_samples * info().n_coordinates, n_samples * info().n_dofs);
        const pdmp_motion outputs = detail::to_c(trajectory);
        detail::check([&](pdmp_text error) {
            return pdmp_model_rollout(get(), &c, dt, n_samples, &outputs, error);
        });
        return trajectory;
    }

    /// Computes the most probable movement through points, see pdmp_model_through.
    Passage through(const std::vector<Point> &points, const Conditions &conditions = {},
                    const PassageOptions &options = {}) const {
        std::vector<pdmp_point> c_points;
        for (const Point &point : points) c_points.push_back(detail::to_c(point));
        const pdmp_conditions c = detail::to_c(conditions);
        const pdmp_passage_options c_options{detail::to_c(options.context), detail::to_c(options.from_phase),
                                             detail::to_c(options.deviation)};
        pdmp_passage *made = nullptr;
        detail::check([&](pdmp_text error) {
            return pdmp_model_through(get(), c_points.data(), c_points.size(), &c, &c_options, &made, error);
        });
        const std::shared_ptr<const pdmp_passage> forcing(made, [made](const pdmp_passage *) { pdmp_passage_free(made); });
        pdmp_passage_info info{};
        pdmp_passage_describe(made, &info);
        Conditions own = detail::copy(info.conditions);
        own.forcing = forcing;
        return {own, forcing, info.distance, info.n_constraints, info.far != 0, detail::copy(info.displacement)};
    }

    /// Returns the handle, which the model owns; NULL after a move.
    const pdmp_model *get() const noexcept { return model_.get(); }

private:
    template <class Load>
    explicit Model(Load load) {
        pdmp_model *model = nullptr;
        detail::check([&](pdmp_text error) { return load(&model, error); });
        model_.reset(model);
    }

    template <class Call>
    Conditions conditions(Call call) const {
        std::vector<double> numbers(info().n_conditions);
        pdmp_conditions c{};
        detail::check([&](pdmp_text error) { return call(&c, detail::buffer(numbers), error); });
        return detail::copy(c);
    }

    struct Free {
        void operator()(pdmp_model *model) const noexcept { pdmp_model_free(model); }
    };

    std::unique_ptr<pdmp_model, Free> model_;
};

/// Controller of one movement. One thread at a time may use it; it may outlive its model.
class Controller {
public:
    /// Starts a movement with ticks of `dt` seconds. `transition` is the time, in seconds, after which 99 % of a
    /// commanded change has taken effect, see pdmp_settings.
    Controller(const Model &model, double dt, const Conditions &conditions = {},
               const std::optional<double> &transition = {})
        : n_coordinates_(model.info().n_coordinates), n_dofs_(model.info().n_dofs) {
        const pdmp_settings settings{dt, detail::to_c(transition), {}};
        const pdmp_conditions c = detail::to_c(conditions);
        pdmp_controller *controller = nullptr;
        detail::check([&](pdmp_text error) {
            return pdmp_controller_new(model.get(), &settings, &c, &controller, error);
        });
        controller_.reset(controller);
    }

    /// Copies the controller with its state, see pdmp_controller_clone.
    Controller clone() const {
        pdmp_controller *copy = nullptr;
        detail::check([&](pdmp_text error) { return pdmp_controller_clone(get(), {}, &copy, error); });
        return Controller(copy, *this);
    }

    /// Copies the state of another controller without allocation, see pdmp_controller_copy.
    pdmp_status copy_from(const Controller &other) noexcept { return pdmp_controller_copy(other.get(), get()); }

    /// Starts a new movement, see pdmp_controller_reset.
    void reset(const Conditions &conditions = {}) {
        const pdmp_conditions c = detail::to_c(conditions);
        const pdmp_status status = pdmp_controller_reset(get(), &c);
        if (status < 0) throw Error(status, error());
    }

    // Commands, see the functions pdmp_controller_set_... and pdmp_controller_release.
    pdmp_status set_style(pdmp_vector style) noexcept { return pdmp_controller_set_style(get(), style); }
    pdmp_status set_goal(pdmp_vector goal) noexcept { return pdmp_controller_set_goal(get(), goal); }
    pdmp_status set_goal_velocity(pdmp_vector velocity) noexcept {
        return pdmp_controller_set_goal_velocity(get(), velocity);
    }
    pdmp_status set_anchor(pdmp_vector anchor) noexcept { return pdmp_controller_set_anchor(get(), anchor); }
    pdmp_status set_tau(double tau) noexcept { return pdmp_controller_set_tau(get(), tau); }
    pdmp_status set_amplitude(double amplitude) noexcept { return pdmp_controller_set_amplitude(get(), amplitude); }
    pdmp_status set_compliance(double stopping, double tracking) noexcept {
        return pdmp_controller_set_compliance(get(), stopping, tracking);
    }

    pdmp_status set_phase(double phase) noexcept { return pdmp_controller_set_phase(get(), phase); }
    pdmp_status set_phase_gain(double gain) noexcept { return pdmp_controller_set_phase_gain(get(), gain); }
    pdmp_status set_speed(double speed) noexcept { return pdmp_controller_set_speed(get(), speed); }
    pdmp_status set_tolerance(double tolerance) noexcept { return pdmp_controller_set_tolerance(get(), tolerance); }
    pdmp_status release() noexcept { return pdmp_controller_release(get()); }

    /// Sets the limits of the robot, see pdmp_controller_set_limits; those of Limits{} are none.
    pdmp_status set_limits(const Limits &limits) noexcept {
        const pdmp_limits c = detail::to_c(limits);
        return pdmp_controller_set_limits(get(), &c);
    }

    /// Writes for each degree of freedom the limit that determined its acceleration in the last tick.
    pdmp_status limited(std::vector<pdmp_limit> &limited) noexcept {
        return pdmp_controller_limited(get(), limited.data(), limited.size());
    }

    /// Adds the additional forcing of a passage to that in force, see pdmp_controller_add_forcing.
    pdmp_status add_forcing(const Passage &passage) noexcept {
        return pdmp_controller_add_forcing(get(), passage.forcing.get());
    }

    /// Advances the movement by one tick without a new command.
    pdmp_status step() noexcept { return pdmp_controller_step(get()); }

    /// Applies a command, advances the movement by one tick, and writes the motion.
    pdmp_status update(const pdmp_command &command, Motion &motion) noexcept {
        const pdmp_motion outputs = detail::to_c(motion);
        return pdmp_controller_update(get(), &command, &outputs);
    }

    /// Writes the present motion.
    pdmp_status read(Motion &motion) noexcept {
        const pdmp_motion outputs = detail::to_c(motion);
        return pdmp_controller_read(get(), &outputs);
    }

    /// Writes the time since the start, in seconds, and the phase; returns PDMP_WORKING or PDMP_FINISHED.
    pdmp_status progress(double *time = nullptr, double *phase = nullptr) const noexcept {
        return pdmp_controller_progress(get(), time, phase);
    }

    /// Computes the future of the movement at the times 0, dt, ..., (n_samples - 1) dt from now, see pdmp_controller_forecast.
    Trajectory forecast(double dt, std::size_t n_samples) {
        Trajectory trajectory(n_samples * n_coordinates_, n_samples * n_dofs_);
        const pdmp_motion outputs = detail::to_c(trajectory);
        const pdmp_status status = pdmp_controller_forecast(get(), dt, n_samples, &outputs);
        if (status < 0) throw Error(status, error());
        return trajectory;
    }

    /// Returns the message of the last call that failed; empty before the first error.
    std::string error() const {
        char text[512];
        pdmp_controller_error(get(), {text, sizeof text});
        return text;
    }

    /// Returns the handle, which the controller owns; NULL after a move.
    pdmp_controller *get() const noexcept { return controller_.get(); }

private:
    Controller(pdmp_controller *copy, const Controller &of) noexcept
        : n_coordinates_(of.n_coordinates_), n_dofs_(of.n_dofs_), controller_(copy) {}

    struct Free {
        void operator()(pdmp_controller *controller) const noexcept { pdmp_controller_free(controller); }
    };

    std::size_t n_coordinates_, n_dofs_;
    std::unique_ptr<pdmp_controller, Free> controller_;
};

/// Positions to come: n_coordinates means and n_dofs standard deviations for each time, one row after the other.
struct Continuation {
    /// Allocates the vectors.
    Continuation(std::size_t n_times, std::size_t n_coordinates, std::size_t n_dofs)
        : position(n_times * n_coordinates), deviation(n_times * n_dofs) {}

    std::vector<double> position, deviation;
};

/// Filter that estimates a movement while it is observed. One thread at a time may use it.
class Recogniser {
public:
    /// Creates a recogniser from a model file with a prior. `path` is a UTF-8 string. An empty `context` is not known.
    static Recogniser load(const std::string &path, const Timing &timing = {}, const std::vector<double> &context = {}) {
        return Recogniser(timing, [&](const pdmp_timing *t, pdmp_recogniser **made, pdmp_text error) {
            return pdmp_recogniser_load(path.c_str(), detail::to_c(context), t, made, error);
        });
    }

    /// Creates a recogniser from the `size` bytes of a model file with a prior.
    static Recogniser from_bytes(const void *bytes, std::size_t size, const Timing &timing = {},
                                 const std::vector<double> &context = {}) {
        return Recogniser(timing, [&](const pdmp_timing *t, pdmp_recogniser **made, pdmp_text error) {
            return pdmp_recogniser_from_bytes(bytes, size, detail::to_c(context), t, made, error);
        });
    }

    /// Includes an observation, see pdmp_recogniser_update; a coordinate that is not observed is NaN.
    pdmp_status update(double time, pdmp_vector position) noexcept {
        return pdmp_recogniser_update(get(), time, position);
    }

    /// Writes the estimate, whose members are valid until the next call, see pdmp_recogniser_estimate.
    pdmp_status estimate(pdmp_estimate &estimate) noexcept { return pdmp_recogniser_estimate(get(), &estimate); }

    /// Returns a copy of the estimated conditions of the whole movement.
    Conditions conditions() {
        pdmp_estimate own{};
        if (const pdmp_status status = estimate(own); status < 0) throw Error(status, error());
        return detail::copy(own.conditions);
    }

    /// Writes the positions at times from the last observation on, see pdmp_recogniser_continuation.
    pdmp_status continuation(pdmp_vector time, Continuation &ahead) noexcept {
        return pdmp_recogniser_continuation(get(), time, detail::buffer(ahead.position), detail::buffer(ahead.deviation));
    }

    /// Forgets all observations.
    pdmp_status reset() noexcept { return pdmp_recogniser_reset(get()); }

    /// Returns the message of the last call that failed; empty before the first error.
    std::string error() const {
        char text[512];
        pdmp_recogniser_error(get(), {text, sizeof text});
        return text;
    }

    /// Returns the handle, which the recogniser owns; NULL after a move.
    pdmp_recogniser *get() const noexcept { return recogniser_.get(); }

private:
    template <class Load>
    Recogniser(const Timing &timing, Load load) {
        const pdmp_timing c{timing.earliest, timing.latest, detail::to_c(timing.duration)};
        pdmp_recogniser *made = nullptr;
        detail::check([&](pdmp_text error) { return load(&c, &made, error); });
        recogniser_.reset(made);
    }

    struct Free {
        void operator()(pdmp_recogniser *recogniser) const noexcept { pdmp_recogniser_free(recogniser); }
    };

    std::unique_ptr<pdmp_recogniser, Free> recogniser_;
};

/// Position and unit quaternion x, y, z, qw, qx, qy, qz.
using Pose = std::array<double, 7>;

/// Conversion between the poses of two arms and an absolute and a relative pose, see pdmp_absolute_relative. Neither direction
/// allocates; both throw pdmp::Error for poses that are none, or arms half a turn from the reference.
class TwoArms {
public:
    /// Creates the conversion by the shorter geodesic.
    TwoArms() = default;

    /// Creates the conversion about a relative rotation of the task, qw, qx, qy, qz.
    explicit TwoArms(const std::array<double, 4> &reference) noexcept : reference_(reference) {}

    /// Returns the absolute and the relative pose.
    std::array<Pose, 2> absolute_relative(const Pose &left, const Pose &right) const {
        return convert(pdmp_absolute_relative, left, right);
    }

    /// Returns the poses of the left and the right arm.
    std::array<Pose, 2> left_right(const Pose &absolute, const Pose &relative) const {
        return convert(pdmp_left_right, absolute, relative);
    }

private:
    template <class Function>
    std::array<Pose, 2> convert(Function function, const Pose &first, const Pose &second) const {
        std::array<Pose, 2> poses;
        detail::check([&](pdmp_text error) {
            const pdmp_buffer buffers[] = {{poses[0].data(), 7}, {poses[1].data(), 7}};
            return function(view(first), view(second), view(reference_), buffers[0], buffers[1], error);
        });
        return poses;
    }

    std::array<double, 4> reference_{1.0, 0.0, 0.0, 0.0};
};

}  // namespace pdmp

#endif  // PDMP_HPP

// The C++17 face of pdmp.h: ownership, vectors and exceptions, and nothing of its own.
//
// Making and resetting throw pdmp::Error. What runs in the loop is noexcept and answers a pdmp_status: below zero it
// was refused, nothing has changed, and Controller::error tells why. Lengths, units and equations are those of pdmp.h.

#ifndef PDMP_HPP
#define PDMP_HPP

#include <cstddef>
#include <iterator>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "pdmp.h"

namespace pdmp {

/// A call that was refused, and why.
class Error : public std::runtime_error {
public:
    Error(pdmp_status status, const std::string &text) : std::runtime_error(text), status_(status) {}

    pdmp_status status() const noexcept { return status_; }

private:
    pdmp_status status_;
};

/// The numbers of a vector, an array or the like, which must outlive what is told of them.
template <class Numbers>
pdmp_vector view(const Numbers &numbers) noexcept {
    return {std::data(numbers), static_cast<std::size_t>(std::size(numbers))};
}

template <class Numbers>
pdmp_vector view(const Numbers &&) = delete;

/// What a movement starts with; what is empty is that of the nominal demonstration.
struct Conditions {
    std::vector<double> style, goal, anchor, start, velocity;
    std::optional<double> amplitude, tau, phase;
};

/// A motion, one number per DoF.
struct Motion {
    explicit Motion(std::size_t n_dofs) : position(n_dofs), velocity(n_dofs), acceleration(n_dofs) {}

    std::vector<double> position, velocity, acceleration;
};

namespace detail {

/// Makes a call that tells its reason, and throws it if the call is refused.
template <class Call>
void check(Call call) {
    char text[512] = "";
    const pdmp_status status = call(pdmp_text{text, sizeof text});
    if (status < 0) throw Error(status, text);
}

inline pdmp_vector told(const std::vector<double> &numbers) noexcept {
    return numbers.empty() ? pdmp_vector{} : view(numbers);
}

inline const double *told(const std::optional<double> &number) noexcept { return number ? &*number : nullptr; }

inline pdmp_conditions told(const Conditions &c) noexcept {
    return {told(c.style),    told(c.goal),      told(c.anchor), told(c.start),
            told(c.velocity), told(c.amplitude), told(c.tau),    told(c.phase)};
}

inline std::vector<double> copy(pdmp_vector numbers) { return {numbers.data, numbers.data + numbers.length}; }

inline pdmp_motion room(Motion &motion) noexcept {
    const auto room = [](std::vector<double> &numbers) { return pdmp_buffer{numbers.data(), numbers.size()}; };
    return {room(motion.position), room(motion.velocity), room(motion.acceleration)};
}

}  // namespace detail

/// A learnt primitive. It never changes; threads and controllers share it.
class Model {
public:
    /// Reads a model file from a path in UTF-8.
    static Model load(const std::string &path) {
        return Model([&](pdmp_model **model, pdmp_text error) { return pdmp_model_load(path.c_str(), model, error); });
    }

    /// Reads a model from the bytes of a file.
    static Model from_bytes(const void *bytes, std::size_t size) {
        return Model([&](pdmp_model **model, pdmp_text error) {
            return pdmp_model_from_bytes(bytes, size, model, error);
        });
    }

    /// Kind, sizes and times.
    pdmp_info info() const noexcept {
        pdmp_info info{};
        pdmp_model_describe(get(), &info);
        return info;
    }

    /// Name of a degree of freedom, counted from 0; empty if there is none such.
    std::string name(std::size_t dof) const {
        const char *name = pdmp_model_name(get(), dof);
        return name ? name : "";
    }

    /// A label that a value of the contexts may be, both counted from 0; empty past the last, and where it is a number.
    std::string label(std::size_t value, std::size_t label) const {
        const char *found = pdmp_model_label(get(), value, label);
        return found ? found : "";
    }

    /// Conditions that repeat a demonstration, counted from 0.
    Conditions demonstration(std::size_t demonstration) const {
        return conditions([&](pdmp_conditions *told, pdmp_buffer numbers, pdmp_text error) {
            return pdmp_model_demonstration(get(), demonstration, told, numbers, error);
        });
    }

    /// Conditions of the movement predicted for a context (n_contexts).
    Conditions predict(const std::vector<double> &context) const {
        return conditions([&](pdmp_conditions *told, pdmp_buffer numbers, pdmp_text error) {
            return pdmp_model_predict(get(), view(context), told, numbers, error);
        });
    }

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
        pdmp_conditions told{};
        detail::check([&](pdmp_text error) { return call(&told, {numbers.data(), numbers.size()}, error); });
        using detail::copy;
        return {copy(told.style),    copy(told.goal), copy(told.anchor), copy(told.start),
                copy(told.velocity), std::nullopt,    *told.tau,          std::nullopt};
    }

    struct Free {
        void operator()(pdmp_model *model) const noexcept { pdmp_model_free(model); }
    };

    std::unique_ptr<pdmp_model, Free> model_;
};

/// A running primitive. One thread at a time uses it; it may outlive its model.
class Controller {
public:
    /// Starts a movement with ticks of dt seconds; transition is the time to 99 % of what is commanded.
    Controller(const Model &model, double dt, const Conditions &conditions = {},
               const std::optional<double> &transition = {}) {
        const pdmp_settings settings{dt, detail::told(transition), {}};
        const pdmp_conditions told = detail::told(conditions);
        pdmp_controller *controller = nullptr;
        detail::check([&](pdmp_text error) {
            return pdmp_controller_new(model.get(), &settings, &told, &controller, error);
        });
        controller_.reset(controller);
    }

    /// Starts again under other conditions.
    void reset(const Conditions &conditions = {}) {
        const pdmp_conditions told = detail::told(conditions);
        const pdmp_status status = pdmp_controller_reset(get(), &told);
        if (status < 0) throw Error(status, error());
    }

    pdmp_status set_style(pdmp_vector style) noexcept { return pdmp_controller_set_style(get(), style); }
    pdmp_status set_goal(pdmp_vector goal) noexcept { return pdmp_controller_set_goal(get(), goal); }
    pdmp_status set_anchor(pdmp_vector anchor) noexcept { return pdmp_controller_set_anchor(get(), anchor); }
    pdmp_status set_tau(double tau) noexcept { return pdmp_controller_set_tau(get(), tau); }
    pdmp_status set_amplitude(double amplitude) noexcept { return pdmp_controller_set_amplitude(get(), amplitude); }
    pdmp_status set_compliance(double stopping, double tracking) noexcept {
        return pdmp_controller_set_compliance(get(), stopping, tracking);
    }

    pdmp_status set_speed(double speed) noexcept { return pdmp_controller_set_speed(get(), speed); }
    pdmp_status release() noexcept { return pdmp_controller_release(get()); }

    /// One tick with nothing new commanded.
    pdmp_status step() noexcept { return pdmp_controller_step(get()); }

    /// One tick under a command, with the motion after it.
    pdmp_status update(const pdmp_command &command, Motion &motion) noexcept {
        const pdmp_motion room = detail::room(motion);
        return pdmp_controller_update(get(), &command, &room);
    }

    /// The motion as it is now.
    pdmp_status read(Motion &motion) noexcept {
        const pdmp_motion room = detail::room(motion);
        return pdmp_controller_read(get(), &room);
    }

    /// Whether the movement goes on, with the seconds since its start and its phase.
    pdmp_status progress(double *time = nullptr, double *phase = nullptr) const noexcept {
        return pdmp_controller_progress(get(), time, phase);
    }

    /// Why the last call that was refused was refused; empty before the first.
    std::string error() const {
        char text[512];
        pdmp_controller_error(get(), {text, sizeof text});
        return text;
    }

    pdmp_controller *get() const noexcept { return controller_.get(); }

private:
    struct Free {
        void operator()(pdmp_controller *controller) const noexcept { pdmp_controller_free(controller); }
    };

    std::unique_ptr<pdmp_controller, Free> controller_;
};

}  // namespace pdmp

#endif  // PDMP_HPP

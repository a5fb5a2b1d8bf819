// Parametric dynamic movement primitives: load a model and run it in a control loop.
//
// - A pointer and the length it reaches are one argument, and a struct that is all zero tells nothing: what is not told
//   stays as it was, or is that of the nominal demonstration. Numbers are counted, texts and memory are in bytes.
// - A status below zero is a refusal. Its call changed nothing, but for PDMP_INTERNAL, and a text says what is wrong and
//   what would be right.
// - What runs in the loop neither allocates nor locks: pdmp_controller_step, _update, _set_..., _read, _progress and
//   _error. All else may take its time.
// - Structs may grow from version to version: compile anew with each.
// - Threads: a model can be shared; a controller is used by one thread at a time.
//
// Link with -lpdmp; the static library wants -lpthread -ldl -lm too. In C++, pdmp.hpp wraps all this.
// Made by cbindgen from crates/pdmp-capi/src; not to be edited here.

#ifndef PDMP_H
#define PDMP_H

#include <stddef.h>

/// What a call came to; below zero it was refused.
typedef enum {
    /// Done.
    PDMP_OK = 0,
    /// The movement goes on; a rhythmic one always does.
    PDMP_WORKING = 1,
    /// The demonstrated time is over, and position and velocity have settled on the goal.
    PDMP_FINISHED = 2,
    /// NULL where a pointer is needed.
    PDMP_NULL = -1,
    /// A wrong length.
    PDMP_LENGTH = -2,
    /// A number that is not finite, or outside its range.
    PDMP_RANGE = -3,
    /// What this model does not have: an anchor if it moves to a goal, or contexts if it was learnt without.
    PDMP_ABSENT = -4,
    /// A file that cannot be read.
    PDMP_IO = -5,
    /// A model file that is damaged, foreign or of another version.
    PDMP_FILE = -6,
    /// Memory that is too small or not aligned.
    PDMP_MEMORY = -7,
    /// A defect of this library. A controller that answers so must be reset or freed.
    PDMP_INTERNAL = -8,
} pdmp_status;

/// The kind of movement.
typedef enum {
    /// From a start to a goal.
    PDMP_DISCRETE,
    /// Around an anchor, periodically.
    PDMP_RHYTHMIC,
} pdmp_kind;

/// A running primitive: a model, its commands and its state. One thread at a time uses it.
typedef struct pdmp_controller pdmp_controller;

/// A learnt primitive. It never changes, and threads can share it.
typedef struct pdmp_model pdmp_model;

/// Room for a text in UTF-8 with its closing zero; `{NULL, 0}` if it is not wanted. A longer text is cut to fit.
typedef struct {
    /// Where the first byte goes.
    char *data;
    /// Bytes there is room for.
    size_t size;
} pdmp_text;

/// What there is to know of a model before it moves.
typedef struct {
    /// Discrete or rhythmic.
    pdmp_kind kind;
    /// Number of degrees of freedom D.
    size_t n_dofs;
    /// Dimension J of the style parameter.
    size_t n_styles;
    /// Number of demonstrations M.
    size_t n_demos;
    /// Length Q of a context; 0 if the model was learnt without.
    size_t n_contexts;
    /// Numbers that pdmp_model_demonstration and pdmp_model_predict write at most: n_styles + 2 n_dofs + 1.
    size_t n_conditions;
    /// Time constant tau of the nominal demonstration, in seconds.
    double tau;
    /// Duration or period of the nominal demonstration, in seconds.
    double duration;
} pdmp_info;

/// Numbers to read; `{NULL, 0}` is nothing told.
typedef struct {
    /// The first number.
    const double *data;
    /// How many there are.
    size_t length;
} pdmp_vector;

/// What a movement starts with; what is not told is that of the nominal demonstration.
typedef struct {
    /// Style s (n_styles).
    pdmp_vector style;
    /// Goal g (n_dofs), discrete.
    pdmp_vector goal;
    /// Anchor y_a (n_dofs), rhythmic.
    pdmp_vector anchor;
    /// Start position (n_dofs); a rhythmic movement otherwise starts on its cycle.
    pdmp_vector start;
    /// Start velocity (n_dofs), per second; otherwise that of the demonstrations.
    pdmp_vector velocity;
    /// Amplitude r_0, rhythmic; otherwise 1.
    const double *amplitude;
    /// Time constant tau, in seconds.
    const double *tau;
    /// Phase phi at which a rhythmic movement starts, in rad, on its limit cycle; otherwise 0.
    const double *phase;
} pdmp_conditions;

/// Room for numbers; `{NULL, 0}` if they are not wanted. More room than needed is left as it is.
typedef struct {
    /// Where the first number goes.
    double *data;
    /// How many there is room for, at least as many as are written.
    size_t length;
} pdmp_buffer;

/// Memory of the caller's; `{NULL, 0}` to have it allocated.
typedef struct {
    /// The first byte.
    void *data;
    /// How many there are.
    size_t size;
} pdmp_memory;

/// What a controller is made with.
typedef struct {
    /// Length of a tick, in seconds.
    double dt;
    /// Time to 99 % of a changed style, tau, goal or anchor, in seconds; 0 is the paper's immediate switch, and without
    /// it a tenth of the nominal duration (discrete) or a quarter of the nominal period (rhythmic) serves. A goal takes
    /// what remains of the movement if that is longer, unless transport is immediate.
    const double *transition;
    /// Where the controller is put, pdmp_controller_size bytes aligned to pdmp_controller_alignment; its vectors, whose
    /// lengths are the model's, are allocated even so.
    pdmp_memory memory;
} pdmp_settings;

/// Terms of the user's own, constant over a tick: both or none.
typedef struct {
    /// c_v (n_dofs), added to the velocity, per second.
    pdmp_vector velocity;
    /// c_a (n_dofs), added to the acceleration, per second squared.
    pdmp_vector acceleration;
} pdmp_coupling;

/// All that one tick is told; what is not told stays as it was.
///
/// Style, goal, anchor, tau and amplitude stay in force until they are commanded again, measured until it is measured
/// again or pdmp_controller_release; dt and coupling hold for this tick alone.
typedef struct {
    /// Style s (n_styles) to go to.
    pdmp_vector style;
    /// Goal g (n_dofs) to go to, discrete.
    pdmp_vector goal;
    /// Anchor y_a (n_dofs) to go to, rhythmic.
    pdmp_vector anchor;
    /// Time constant tau to go to, in seconds.
    const double *tau;
    /// Amplitude r_0 to go to, rhythmic.
    const double *amplitude;
    /// Length of this tick, in seconds, if it differs from the controller's.
    const double *dt;
    /// Position (n_dofs) at which the robot is now, in the unit of each DoF; NULL if it was not measured anew.
    pdmp_vector measured;
    /// The user's own terms.
    pdmp_coupling coupling;
} pdmp_command;

/// Where a motion is written, as far as it is wanted. It may overlap with what the tick is told.
typedef struct {
    /// Position y (n_dofs), in the unit of each DoF.
    pdmp_buffer position;
    /// Velocity (n_dofs), per second.
    pdmp_buffer velocity;
    /// Acceleration (n_dofs), per second squared.
    pdmp_buffer acceleration;
} pdmp_motion;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/// Version of the library, such as "0.1.0".
const char *pdmp_version(void);

/// Reads a model file from a path in UTF-8. The model is NULL if it is refused.
///
/// # Safety
/// `path` is NULL or ends in a zero byte, and `error` has the room that it tells.
pdmp_status pdmp_model_load(const char *path, pdmp_model **model, pdmp_text error);

/// Reads a model from the bytes of a file. The model is NULL if it is refused.
///
/// # Safety
/// `bytes` is NULL or points to `size` bytes, and `error` has the room that it tells.
pdmp_status pdmp_model_from_bytes(const void *bytes, size_t size, pdmp_model **model, pdmp_text error);

/// Frees a model. Its controllers go on: what they need of it stays. With NULL it does nothing.
void pdmp_model_free(pdmp_model *model);

/// Tells kind, sizes and times of a model.
pdmp_status pdmp_model_describe(const pdmp_model *model, pdmp_info *info);

/// Name of a degree of freedom, counted from 0, in UTF-8. It lives as long as the model, and is NULL past the last.
const char *pdmp_model_name(const pdmp_model *model, size_t dof);

/// Conditions that repeat a demonstration, counted from 0: its style, goal and start or anchor, and tau.
///
/// Of a model whose time was warped or has landmarks, tau is that of the whole duration: within it the movement hurries and
/// pauses as the nominal one does.
///
/// They are written to `numbers`, which has room for pdmp_info.n_conditions of them, and `conditions` points there.
///
/// # Safety
/// `numbers` and `error` have the room that they tell.
pdmp_status pdmp_model_demonstration(const pdmp_model *model,
                                     size_t demonstration,
                                     pdmp_conditions *conditions,
                                     pdmp_buffer numbers,
                                     pdmp_text error);

/// A label that a value of the contexts may be, both counted from 0, in UTF-8. It lives as long as the model, and is NULL
/// past the last, and where the value is a number. In a context a label is given by its index.
const char *pdmp_model_label(const pdmp_model *model,
                             size_t value,
                             size_t label);

/// Conditions of the movement predicted for a context (n_contexts), as in Section 4.1.2: style, goal and start or anchor,
/// and tau, that of the whole duration. A label is given by its index, see pdmp_model_label.
///
/// They are written to `numbers`, which has room for pdmp_info.n_conditions of them, and `conditions` points there.
///
/// # Safety
/// `context` points to the numbers that it tells, and `numbers` and `error` have the room that they tell.
pdmp_status pdmp_model_predict(const pdmp_model *model,
                               pdmp_vector context,
                               pdmp_conditions *conditions,
                               pdmp_buffer numbers,
                               pdmp_text error);

/// Bytes of a controller in memory of the caller's.
size_t pdmp_controller_size(void);

/// Alignment of a controller in memory of the caller's, in bytes.
size_t pdmp_controller_alignment(void);

/// Makes a controller and starts its movement; NULL conditions are those of the nominal demonstration. The controller
/// is NULL if it is refused. The model may be freed before it.
///
/// # Safety
/// What `settings` and `conditions` point to is valid, their memory is used by nothing else, and `error` has the room
/// that it tells.
pdmp_status pdmp_controller_new(const pdmp_model *model,
                                const pdmp_settings *settings,
                                const pdmp_conditions *conditions,
                                pdmp_controller **controller,
                                pdmp_text error);

/// Makes a controller that goes on bit for bit as another would, to look ahead from where that is; it is made like the
/// other in memory of the caller's, or allocated. The copy is NULL if it is refused.
///
/// # Safety
/// `memory` is used by nothing else, and `error` has the room that it tells.
pdmp_status pdmp_controller_clone(const pdmp_controller *controller,
                                  pdmp_memory memory,
                                  pdmp_controller **copy,
                                  pdmp_text error);

/// Frees a controller. Memory of the caller's is the caller's again. With NULL it does nothing.
///
/// # Safety
/// `controller` is NULL or was made by pdmp_controller_new, and is not used again.
void pdmp_controller_free(pdmp_controller *controller);

/// Starts again under other conditions; NULL are those of the nominal demonstration.
///
/// # Safety
/// What `conditions` points to is valid.
pdmp_status pdmp_controller_reset(pdmp_controller *controller, const pdmp_conditions *conditions);

/// Sets the style s (n_styles) to go to.
///
/// # Safety
/// `style` points to the numbers that it tells.
pdmp_status pdmp_controller_set_style(pdmp_controller *controller, pdmp_vector style);

/// Sets the goal g (n_dofs) of a discrete movement.
///
/// # Safety
/// `goal` points to the numbers that it tells.
pdmp_status pdmp_controller_set_goal(pdmp_controller *controller, pdmp_vector goal);

/// Sets the anchor y_a (n_dofs) of a rhythmic movement.
///
/// # Safety
/// `anchor` points to the numbers that it tells.
pdmp_status pdmp_controller_set_anchor(pdmp_controller *controller, pdmp_vector anchor);

/// Sets the time constant tau, in seconds; the rate 1/tau is what passes the filter.
pdmp_status pdmp_controller_set_tau(pdmp_controller *controller, double tau);

/// Sets the amplitude r_0 of a rhythmic movement; r follows by Eq. (4).
pdmp_status pdmp_controller_set_amplitude(pdmp_controller *controller, double amplitude);

/// Sets the speed, the share of the rate 1/tau at which the path is followed: 0 pauses on the path, 1 goes on. A change
/// passes the filter of tau, and stays in force over pdmp_controller_reset.
pdmp_status pdmp_controller_set_speed(pdmp_controller *controller, double speed);

/// Sets how much a measured position stops the phase, k_s, and pulls the movement, k_t per unit of the clock.
///
/// By default k_s = 1000, so that an error of a tenth of the range slows the phase elevenfold, and k_t = 10 over the
/// demonstrated stretch of the clock, T/tau or 2 pi; 0 is without.
pdmp_status pdmp_controller_set_compliance(pdmp_controller *controller, double stopping, double tracking);

/// Forgets the measured position: no robot follows any more, until the next one is measured.
pdmp_status pdmp_controller_release(pdmp_controller *controller);

/// One tick with nothing new commanded. Answers whether the movement goes on.
pdmp_status pdmp_controller_step(pdmp_controller *controller);

/// One tick under a command, with the motion written where the caller wants it; NULL is nothing told, or not wanted.
/// Answers whether the movement goes on.
///
/// What is refused is refused as a whole: no part of the command takes effect, and no time passes. A perturbation is
/// held over the tick:
///
///     tau y' = z + w(u) + k_t d + tau c_v
///     tau z' = alpha_z (beta_z (g - y) - z) + tau^2 c_a
///     tau u' = k = 1 / (1 + k_s |d / range|^2)
///     tau o' = 5 k (e - o) / extent
///
/// with the coupling terms c_v and c_a, and d, what of the error e = m - y at the measured position m lies beyond the
/// error o that is expected by now. The last e stays in force until the next measurement or pdmp_controller_release.
///
/// # Safety
/// What `command` and `motion` point to is valid.
pdmp_status pdmp_controller_update(pdmp_controller *controller, const pdmp_command *command, const pdmp_motion *motion);

/// Reads the motion as it is now. Answers whether it goes on.
///
/// # Safety
/// What `motion` points to is valid.
pdmp_status pdmp_controller_read(pdmp_controller *controller, const pdmp_motion *motion);

/// Tells the seconds since the start, and the phase: x in (0, 1] where discrete, phi in [0, 2 pi) where rhythmic; NULL
/// is not wanted. Answers whether the movement goes on.
pdmp_status pdmp_controller_progress(const pdmp_controller *controller, double *time, double *phase);

/// Tells why the last call that this controller refused was refused, and returns the length of that text without its
/// closing zero. There is none, of length 0, before the first.
///
/// # Safety
/// `text` has the room that it tells.
size_t pdmp_controller_error(const pdmp_controller *controller, pdmp_text text);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* PDMP_H */

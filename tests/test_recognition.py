"""Recognition of movements from Python: estimates, missing samples, pickles and refusals."""

import pickle

import numpy as np
import pytest

import pdmp

S = np.linspace(0, 1, 61)[:, None]
RISE = S**3 * (10 - 15 * S + 6 * S**2)


def reach(height, goal=0.5, duration=1.0):
    """Returns a reach over an obstacle."""
    path = np.hstack([goal * RISE, height * (4 * S * (1 - S)) ** 3])
    return pdmp.Demonstration(path, dt=duration / 60)


@pytest.fixture(scope="module")
def demos():
    """Returns reaches of random height, length and duration."""
    rng = np.random.default_rng(0)
    return [reach(*rng.uniform([0.1, 0.4, 0.8], [0.5, 0.8, 1.2]).tolist()) for _ in range(12)]


@pytest.fixture(scope="module")
def model(demos):
    """Returns their model."""
    return pdmp.fit(demos)


@pytest.fixture(scope="module")
def prior(model, demos):
    """Returns their prior."""
    return model.prior(demos)


def watched(recogniser, demo, n):
    """Shows the first n samples, with one of two positions missing at times."""
    for k in range(n):
        position = demo.position[k].copy()
        if k % 5 == 3:
            position[k % 2] = np.nan
        recogniser.update(demo.time[k], position)
    return recogniser


def test_half_a_movement_gives_goal_and_time(model, prior):
    """Half of a new reach gives goal, arrival and continuation to a few hundredths."""
    demo = reach(0.27, 0.65, 1.1)
    recogniser = watched(model.recogniser(prior), demo, 31)
    estimate = recogniser.estimate()
    assert np.abs(estimate.goal - demo.position[-1]).max() < 0.03
    assert estimate.arrival == pytest.approx(1.1, abs=0.08)
    assert estimate.fraction == pytest.approx(0.5, abs=0.05)
    ahead = recogniser.continuation(demo.time[31:])
    assert np.abs(ahead.position - demo.position[31:]).max() < 0.05
    assert (ahead.deviation > 0).all() and ahead.time.shape == (30,)


def test_conditions_of_an_estimate_make_the_whole_movement(model, prior):
    """Rollout and controller take the conditions of an estimate."""
    demo = reach(0.4, 0.5, 0.9)
    estimate = watched(model.recogniser(prior), demo, 45).estimate()
    whole = model.rollout(dt=0.01, conditions=estimate.conditions)
    assert np.abs(whole.position[-1] - demo.position[-1]).max() < 0.03
    controller = model.controller(dt=0.01, conditions=estimate.conditions)
    controller.step()


def test_a_known_duration_is_one_hypothesis(model, prior):
    """A given duration is not estimated."""
    recogniser = model.recogniser(prior, duration=1.1)
    assert recogniser.n_hypotheses == 1
    estimate = watched(recogniser, reach(0.2, 0.6, 1.1), 20).estimate()
    assert estimate.duration == pytest.approx(1.1) and estimate.duration_deviation == 0


def test_an_unknown_start_is_found(model, prior):
    """A hand that rests before it reaches arrives later by that time."""
    demo = reach(0.3, 0.6, 1.0)
    recogniser = model.recogniser(prior, starts=(0.0, 0.6))
    rest = np.tile(demo.position[0], (20, 1))
    for k, position in enumerate(np.vstack([rest, demo.position[:40]])):
        recogniser.update(k * demo.time[1], position)
    estimate = recogniser.estimate()
    assert estimate.arrival == pytest.approx(1.0 + 20 * demo.time[1], abs=0.12)


def test_a_pause_holds_the_clock(model, prior):
    """A reach that pauses is stopped, and arrives later by the pause."""
    demo = reach(0.3, 0.6, 1.0)
    recogniser = watched(model.recogniser(prior), demo, 25)
    assert recogniser.estimate().stopped < 0.5
    dt = demo.time[1]
    for k in range(25, 65):
        recogniser.update(k * dt, demo.position[24])
    estimate = recogniser.estimate()
    assert estimate.stopped > 0.5
    assert estimate.fraction == pytest.approx(24 / 60, abs=0.1)
    assert recogniser.continuation([64 * dt + 0.6]).position == pytest.approx(
        demo.position[-1:], abs=0.1
    )
    for k in range(25, 50):
        recogniser.update((k + 40) * dt, demo.position[k])
    estimate = recogniser.estimate()
    assert estimate.stopped < 0.5
    assert estimate.arrival == pytest.approx(1.0 + 40 * dt, abs=0.12)


def test_the_estimate_depends_on_time_differences_alone(model, prior):
    """A shift of the clock shifts the arrival alone; a reset forgets all."""
    demo = reach(0.3)
    first = watched(model.recogniser(prior), demo, 25)
    later = model.recogniser(prior)
    later.update(7.0, demo.position[0])
    later.reset()
    for k in range(25):
        position = demo.position[k].copy()
        if k % 5 == 3:
            position[k % 2] = np.nan
        later.update(demo.time[k] + 100.0, position)
    a, b = first.estimate(), later.estimate()
    np.testing.assert_allclose(a.goal, b.goal, rtol=1e-6)
    assert a.arrival == pytest.approx(b.arrival - 100.0, rel=1e-6)


def test_a_partner_that_is_not_seen_follows_from_the_other():
    """Half of a movement of one of two partners gives the goal of the other, with a wider band."""
    rng = np.random.default_rng(2)
    ends = rng.uniform([0.1, 0.4, 0.8], [0.5, 0.8, 1.2], (13, 3)).tolist()

    def pair(height, goal, duration):
        one = reach(height, goal, duration)
        return pdmp.Demonstration(np.hstack([one.position, 1 - 0.7 * one.position]), time=one.time)

    *pairs, new = [pair(*each) for each in ends]
    model = pdmp.fit(pairs)
    prior = model.prior(pairs)
    alone, together = model.recogniser(prior), model.recogniser(prior)
    for time, position in zip(new.time[:31], new.position, strict=False):
        alone.update(time, [*position[:2], np.nan, np.nan])
        together.update(time, position)
    estimate = alone.estimate()
    assert np.abs(estimate.goal - new.position[-1]).max() < 0.05
    seen, hidden = (each.goal_deviation[2:] for each in (together.estimate(), estimate))
    assert np.linalg.norm(hidden) > 2 * np.linalg.norm(seen)
    ahead = alone.continuation(new.time[31:])
    assert np.abs(ahead.position - new.position[31:]).max() < 0.08


def handover(lean, duration, order="wxyz"):
    """Returns poses of a hand that turns by 1.5 rad on its way, and leans."""
    turn = RISE * [1.5, lean, 0.3 * lean]
    quaternions = pdmp.preprocessing.rotation_vectors_to_quaternions(turn, order=order)
    place = np.hstack([0.5 * RISE, 0.2 * lean * RISE, 0.1 * (4 * S * (1 - S)) ** 3])
    pose = np.hstack([place, quaternions])
    return pdmp.Demonstration(pose, dt=duration / 60, rotations={3: order})


@pytest.mark.parametrize("order", ["wxyz", "xyzw"])
def test_half_a_pose_gives_the_whole(order, tmp_path):
    """Half of a pose gives the rest and the goal, in the columns of the demonstrations."""
    rng = np.random.default_rng(3)
    shapes = rng.uniform([-0.6, 0.8], [0.6, 1.2], (12, 2)).tolist()
    demos = [handover(*shape, order) for shape in shapes]
    model = pdmp.fit(demos)
    path = tmp_path / "hand.safetensors"
    model.save(path, prior=model.prior(demos))
    recogniser = pdmp.load(path).recogniser(pdmp.Prior.load(path))
    new = handover(0.37, 1.05, order)
    for k in range(31):
        pose = new.position[k].copy()
        if k % 5 == 3:
            pose[3 + k % 4] = np.nan  # the whole quaternion is missing
        elif k % 5 == 1:
            pose[3:] *= -1
        recogniser.update(new.time[k], pose)
    estimate, ahead = recogniser.estimate(), recogniser.continuation(new.time[31:])
    assert estimate.goal.shape == (7,) and estimate.goal_deviation.shape == (6,)
    assert ahead.position.shape == (30, 7) and ahead.deviation.shape == (30, 6)
    np.testing.assert_allclose(np.linalg.norm(ahead.position[:, 3:], axis=1), 1, atol=1e-12)
    for found, expected in ((estimate.goal, new.position[-1]), (ahead.position, new.position[31:])):
        assert np.abs(found[..., :3] - expected[..., :3]).max() < 0.03
        cosine = np.abs(np.sum(found[..., 3:] * expected[..., 3:], axis=-1))
        assert 2 * np.arccos(np.minimum(cosine, 1)).max() < 0.15
    whole = model.rollout(dt=0.01, conditions=estimate.conditions)
    assert np.abs(whole.position[-1] - estimate.goal).max() < 0.01
    controller = model.controller(dt=0.01, conditions=estimate.conditions)
    controller.step()
    with pytest.raises(ValueError, match="norm"):
        recogniser.update(2.0, 0.5 * new.position[-1])
    with pytest.raises(ValueError, match="position"):
        recogniser.update(2.0, new.position[-1, :6])


def test_a_context_says_where_a_movement_goes():
    """In a given context the movement is known before it begins; pickles and files keep that."""
    rng = np.random.default_rng(4)
    heights = rng.uniform(0.1, 0.5, 12)
    demos = [reach(height, 0.3 + height, 0.8 + height) for height in heights]
    model = pdmp.fit(demos, contexts={"height": heights})
    prior = model.prior(demos)
    new = reach(0.33, 0.63, 1.13)
    given = watched(model.recogniser(prior, context={"height": 0.33}), new, 3)
    without = watched(model.recogniser(prior), new, 3)

    def error(recogniser):
        return np.abs(recogniser.continuation(new.time[3:]).position - new.position[3:]).max()

    assert error(given) < 0.01
    assert error(given) < 0.4 * error(without)
    same = [pickle.loads(pickle.dumps(prior)), pdmp.Prior.from_bytes(model.to_bytes(prior=prior))]
    for each in same:
        again = watched(model.recogniser(each, context=[0.33]), new, 3)
        np.testing.assert_array_equal(again.estimate().goal, given.estimate().goal)
    with pytest.raises(ValueError, match="context"):
        model.recogniser(prior, context=[0.3, 0.4])
    with pytest.raises((ValueError, KeyError), match="length"):
        model.recogniser(prior, context={"length": 0.3})
    bare = pdmp.fit(demos)
    with pytest.raises(ValueError, match="context.*contexts"):
        bare.recogniser(bare.prior(demos), context=[0.3])


def test_a_context_says_how_a_hand_will_lean():
    """In a given context the orientation at the goal is known before the hand begins to turn."""
    rng = np.random.default_rng(4)
    leans = rng.uniform(-0.6, 0.6, 13)
    *demos, new = [handover(lean, 1 + 0.2 * abs(lean)) for lean in leans.tolist()]
    model = pdmp.fit(demos, contexts={"lean": leans[:12]})
    prior = model.prior(demos)
    errors = []
    for context in (None, {"lean": leans[12]}):
        recogniser = model.recogniser(prior, context=context)
        for k in range(4):
            recogniser.update(new.time[k], new.position[k])
        cosine = abs(recogniser.estimate().goal[3:] @ new.position[-1, 3:])
        errors.append(2 * np.arccos(min(1, cosine)))
    assert errors[1] < 0.05 and errors[1] < 0.5 * errors[0]


def test_a_prior_is_the_same_after_a_pickle(model, prior):
    """A pickled prior gives the same estimates, bit for bit."""
    same = pickle.loads(pickle.dumps(prior))
    assert repr(same) == repr(prior)
    np.testing.assert_array_equal(same.parameters, prior.parameters)
    a, b = (watched(model.recogniser(each), reach(0.3), 20).estimate() for each in (prior, same))
    np.testing.assert_array_equal(a.goal, b.goal)
    np.testing.assert_array_equal(a.goal_deviation, b.goal_deviation)
    assert 0 < prior.bandwidth <= 1 and 0 < prior.tempering <= 1 and prior.correlation_time > 0
    assert prior.residual.shape == (2,)


def test_a_model_file_keeps_the_prior(model, demos, prior, tmp_path):
    """Model and prior are read from one file; a model alone, and a damaged file, have no prior."""
    path = tmp_path / "reach.safetensors"
    model.save(path, prior=prior)
    loaded, same = pdmp.load(path), pdmp.Prior.load(path)
    assert repr(same) == repr(prior)
    a = watched(model.recogniser(prior), reach(0.3), 20).estimate()
    b = watched(loaded.recogniser(same), reach(0.3), 20).estimate()
    np.testing.assert_array_equal(a.goal, b.goal)
    np.testing.assert_array_equal(a.goal_deviation, b.goal_deviation)
    data = model.to_bytes(prior=prior)
    assert data == path.read_bytes() == loaded.to_bytes(prior=pdmp.Prior.from_bytes(data))
    assert pdmp.Model.from_bytes(data).to_bytes() == model.to_bytes() == loaded.to_bytes()

    with pytest.raises(pdmp.ModelFileError, match="no prior"):
        pdmp.Prior.from_bytes(model.to_bytes())
    damaged = bytearray(data)
    damaged[-9] ^= 1
    for read in (pdmp.Prior.from_bytes, pdmp.Model.from_bytes):
        with pytest.raises(pdmp.ModelFileError):
            read(bytes(damaged))
        with pytest.raises(pdmp.ModelFileError):
            read(data[:-9])
    with pytest.raises(FileNotFoundError, match="absent"):
        pdmp.Prior.load(tmp_path / "absent.safetensors")
    with pytest.raises(TypeError, match=r"prior.*expected pdmp\.Prior"):
        model.save(path, prior=model)
    other = pdmp.fit([demo.position[:, :1] for demo in demos], dt=0.01)
    with pytest.raises(ValueError, match="another model"):
        other.save(path, prior=prior)
    assert path.read_bytes() == data


def test_a_prior_needs_the_demonstrations_of_the_fit(model, demos):
    """Another order or unit is named with its numbers; single precision and blocks are the same."""
    with pytest.raises(ValueError, match=r"demo 0: .* but the fit has .*of the fit, in"):
        model.prior(demos[::-1])
    for factor in (-2.0, 57.3):
        scaled = [pdmp.Demonstration(factor * demo.position, time=demo.time) for demo in demos]
        with pytest.raises(ValueError, match=r"demo 0: .*goal\[.* but the fit has"):
            model.prior(scaled)
    rounded = [
        pdmp.Demonstration(demo.position.astype(np.float32), time=demo.time.astype(np.float32))
        for demo in demos
    ]
    np.testing.assert_array_equal(model.prior(rounded).parameters, model.prior(demos).parameters)
    in_blocks = pdmp.fit(lambda: [demos[:5], demos[5:]])
    in_blocks.recogniser(in_blocks.prior(demos))


def test_a_prior_belongs_to_its_model(model, demos, prior, tmp_path):
    """A model of the same dimensions refuses it, also after a pickle or from a file."""
    mirrored = [pdmp.Demonstration(-2 * demo.position, time=demo.time) for demo in demos]
    other = pdmp.fit(mirrored, n_styles=model.n_styles)
    path = tmp_path / "reach.safetensors"
    model.save(path, prior=prior)
    for same in (prior, pickle.loads(pickle.dumps(prior)), pdmp.Prior.load(path)):
        with pytest.raises(ValueError, match="is of another model: their demonstrations differ"):
            other.recogniser(same)
        with pytest.raises(ValueError, match="another model"):
            other.save(tmp_path / "other.safetensors", prior=same)
        for own in (model, pdmp.load(path), pickle.loads(pickle.dumps(model))):
            own.recogniser(same)
    assert not (tmp_path / "other.safetensors").exists()


def test_groups_of_people_are_names(model, demos):
    """Groups are any names, at least two."""
    prior = model.prior(demos, groups=["a", "b", "c"] * 4)
    assert len(prior.parameters) == 12
    with pytest.raises(ValueError, match="groups"):
        model.prior(demos, groups=["a"] * 12)
    with pytest.raises(TypeError, match="groups"):
        model.prior(demos, groups=[[1]] * 12)


def test_bad_input_is_refused(model, demos, prior):
    """An error names the argument."""
    recogniser = model.recogniser(prior)
    with pytest.raises(ValueError, match="update"):
        recogniser.estimate()
    recogniser.update(0.0, demos[0].position[0])
    with pytest.raises(ValueError, match="time"):
        recogniser.update(0.0, demos[0].position[1])
    with pytest.raises(ValueError, match="position"):
        recogniser.update(0.1, [0.0])
    with pytest.raises(ValueError, match="position"):
        recogniser.update(0.1, [np.inf, 0.0])
    with pytest.raises(ValueError, match="time"):
        recogniser.continuation([-1.0])
    with pytest.raises(TypeError, match="prior"):
        model.recogniser(model)
    with pytest.raises(ValueError, match="starts"):
        model.recogniser(prior, starts=(1.0, 0.0))
    with pytest.raises(ValueError, match="demonstrations"):
        model.prior(demos[:5])

"""Factors of targets equal those of numpy's decomposition, for any shape and method."""

import signal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pdmp


def library(n_demos: int, n_values: int, decay: float = 0.5, noise: float = 1e-3) -> np.ndarray:
    """Returns noisy targets of twelve factors with the ratio `decay` of consecutive sizes."""
    random = np.random.default_rng(n_demos)
    left, right = random.normal(size=(n_demos, 12)), random.normal(size=(12, n_values))
    return (left * decay ** np.arange(12)) @ right + noise * random.normal(size=(n_demos, n_values))


@given(
    n_demos=st.integers(1, 60),
    n_values=st.integers(1, 90),
    decay=st.floats(0.05, 1),
    noise=st.sampled_from([0, 1e-6, 1e-2]),
    share=st.floats(0.05, 1),
)
def test_product_is_that_of_numpy_of_the_same_rank(
    n_demos: int, n_values: int, decay: float, noise: float, share: float
) -> None:
    """The product S F_basis equals that of LAPACK, and J follows from the singular values."""
    targets = library(n_demos, n_values, decay, noise)
    u, sigma, vt = np.linalg.svd(targets, full_matrices=False)
    n_styles = 1 + round(share * (len(sigma) - 1))
    found = pdmp.factorise(targets, n_styles=n_styles)
    np.testing.assert_allclose(
        found.singular_values[:n_styles], sigma[:n_styles], atol=1e-10 * sigma[0]
    )
    left = np.sqrt(np.sum(sigma[n_styles:] ** 2) / np.sum(sigma**2))
    assert abs(found.truncation_error - left) < 1e-6
    assert np.abs(found.styles.T @ found.styles - np.eye(n_styles)).max() < 1e-12
    gap = sigma[n_styles - 1] - (sigma[n_styles] if n_styles < len(sigma) else 0)
    if gap > 1e-3 * sigma[0]:
        product = (u[:, :n_styles] * sigma[:n_styles]) @ vt[:n_styles]
        np.testing.assert_allclose(
            found.styles @ found.basis_targets, product, atol=1e-7 * sigma[0]
        )
    by_share = pdmp.factorise(targets, singular_value_share=share).styles.shape[1]
    sums = np.cumsum(sigma) / sigma.sum()
    rounding = 1e-6
    assert np.sum(sums <= share - rounding) < by_share <= np.sum(sums <= share + rounding) + 1


@pytest.mark.parametrize("shape", [(400, 900), (900, 400)])
def test_few_factors_of_a_large_library_are_the_first_of_all(shape: tuple[int, int]) -> None:
    """The leading factors of an iterative method equal those of the whole decomposition."""
    targets = library(*shape)
    u, sigma, _ = np.linalg.svd(targets, full_matrices=False)
    found = pdmp.factorise(targets, n_styles=5)
    assert len(found.singular_values) == 5
    np.testing.assert_allclose(found.singular_values, sigma[:5], rtol=1e-11)
    np.testing.assert_allclose(np.abs(np.sum(found.styles * u[:, :5], axis=0)), 1, rtol=1e-11)


def test_few_styles_of_many_demonstrations_are_the_first_of_more() -> None:
    """A model does not depend on the method of its factorisation."""
    s = np.linspace(0, 1, 120)[:, None]
    random = np.random.default_rng(0)
    waves = np.sin(np.pi * np.arange(1, 7) * s)
    demos = [s**2 * (3 - 2 * s) + waves @ random.normal(size=(6, 3)) * 0.1 for _ in range(300)]
    few = pdmp.fit(demos, dt=0.01, n_styles=3, basis="ngnet")
    more = pdmp.fit(demos, dt=0.01, n_styles=40, basis="ngnet")
    assert len(few.singular_values) == 3 and len(more.singular_values) > 100
    np.testing.assert_allclose(few.singular_values, more.singular_values[:3], rtol=1e-10)
    np.testing.assert_allclose(few.styles, more.styles[:, :3], atol=1e-8)
    assert more.truncation_error < few.truncation_error < 1


def test_truncation_error_is_reported_and_saved() -> None:
    """The truncation error follows from the singular values; it is 0 if demonstrations agree."""
    s = np.linspace(0, 1, 80)[:, None]
    demos = [s**2 * (3 - 2 * s) + h * np.sin(np.pi * s) ** 2 for h in (0.1, 0.4, 0.5)]
    model = pdmp.fit(demos, dt=0.01, n_styles=1)
    sigma = model.singular_values
    expected = np.sqrt(np.sum(sigma[1:] ** 2) / np.sum(sigma**2))
    assert model.truncation_error == pytest.approx(expected, abs=1e-6)
    assert pdmp.fit([demos[0]] * 3, dt=0.01).truncation_error < 1e-6


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_styles": 0}, "0"),
        ({"n_styles": 4}, "4.*3"),
        ({"n_styles": -1}, "must not be negative"),
        ({"singular_value_share": 0.0}, r"singular_value_share = 0.*\(0, 1\]"),
        ({"singular_value_share": float("nan")}, "singular_value_share"),
    ],
)
def test_number_of_factors_out_of_range_is_rejected(
    options: dict[str, float], message: str
) -> None:
    """The error states the number."""
    with pytest.raises(ValueError, match=message):
        pdmp.factorise(np.ones((3, 8)), **options)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e200])
def test_targets_that_are_no_numbers_are_rejected(value: float) -> None:
    """The error states the position."""
    targets = np.ones((3, 8))
    targets[1, 5] = value
    with pytest.raises(ValueError, match=r"targets\[1, 5\]"):
        pdmp.factorise(targets)
    with pytest.raises(ValueError, match="targets"):
        pdmp.factorise(np.ones((0, 8)))


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="this system has no timer signals")
def test_signal_ends_a_long_factorisation() -> None:
    """A signal handler runs between two passes over the targets, and its exception propagates."""

    class Late(Exception):
        pass

    def ring(*_: object) -> None:
        raise Late

    # Equal singular values keep every way busy.
    targets = np.random.default_rng(0).normal(size=(700, 20_000))
    before = signal.signal(signal.SIGALRM, ring)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.1)
        with pytest.raises(Late):
            pdmp.factorise(targets, n_styles=5)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)

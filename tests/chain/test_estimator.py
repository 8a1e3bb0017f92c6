"""The chain's front door, on data that are no robot, and its tutorial."""

import math
import re
import sys
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from gaitchain.chain import LayeredChainModel
from gaitchain.errors import ChainError, GaitchainError, NotFittedError

PAGE = Path(__file__).parents[2] / "docs/chain_alone.md"


@pytest.fixture(scope="module")
def page():
    """The names that the tutorial's code leaves."""
    names = {}
    for code in re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.S):
        exec(compile(code, PAGE.name, "exec"), names)
    return names


def test_the_tutorial_is_true(page):
    model = page["model"]
    assert page["best"].tolist() == [1, 0, 2, 3]
    assert model.best_path(start=0)[1] == 1
    assert np.argmax(model.transmat_[0], axis=1).tolist() == [1, 0, 1]
    menus, liked, disliked = page["menus"][500:], page["liked"], page["disliked"]
    assert model.score(menus[liked]) > model.score(menus[disliked])
    dislike = page["dislike"]
    assert dislike(page["drawn"]).mean() < dislike(page["menus"]).mean()


def test_tools_of_scikit_learn_take_it(page):
    # Imported in the tests: collecting all others takes no second for it.
    from sklearn.model_selection import cross_val_score
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import FunctionTransformer

    menus, costs = page["menus"], page["costs"]
    assert page["priors"].best_params_ == {"prior": 1.0}
    model = LayeredChainModel((3, 2, 4, 4))
    begin, end = slice(0, 300), slice(300, 600)  # the folds of two
    own = [
        model.fit(menus[i], costs[i]).score(menus[j])
        for i, j in ((end, begin), (begin, end))
    ]
    assert cross_val_score(model, menus, costs, cv=2) == pytest.approx(own)
    piped = make_pipeline(FunctionTransformer(), model).fit(menus[begin], costs[begin])
    assert piped.score(menus[end]) == pytest.approx(own[1])
    assert "LayeredChainModel" in piped._repr_html_()


def test_scikit_learn_sees_whether_it_has_learned():
    from sklearn.exceptions import NotFittedError as NotFittedThere
    from sklearn.utils.validation import check_is_fitted

    with pytest.raises(NotFittedThere, match="LayeredChainModel instance is not"):
        check_is_fitted(LayeredChainModel())
    check_is_fitted(LayeredChainModel().fit([[0, 1], [1, 0]]))


def test_probabilities_are_counts():
    model = LayeredChainModel(prior=2.0).fit([[0, 1], [0, 1], [1, 0]], [0.0, 0.5, 1.0])
    # Row 0: prior 1 each, and 1.5 on node 1; row 1: the prior alone.
    assert model.transmat_[0] == pytest.approx(np.array([[2, 5], [3.5, 3.5]]) / 7)
    assert model.startprob_ == pytest.approx([2.5 / 3.5, 1.0 / 3.5])
    expected = np.log(2.5 / 3.5 * 5.0 / 7.0)
    assert model.score([[0, 1]]) == pytest.approx(expected)


def test_probabilities_of_all_sequences_add_up():
    rng = np.random.default_rng(1)
    paths = rng.integers([2, 3, 2], size=(50, 3))
    model = LayeredChainModel().fit(paths, rng.random(50))
    every = np.stack(np.meshgrid(*map(np.arange, (2, 3, 2))), -1).reshape(-1, 3)
    assert np.exp(model.score_samples(every)).sum() == pytest.approx(1.0)


def test_samples_are_as_likely_as_they_score():
    paths = np.random.default_rng(2).integers([2, 2, 2], size=(40, 3))
    model = LayeredChainModel(random_state=3).fit(paths, 0.9 * (paths[:, 0] == 1))
    drawn = model.sample(20000)
    share = (drawn == [0, 1, 1]).all(axis=1).mean()
    assert share == pytest.approx(np.exp(model.score([[0, 1, 1]])), abs=0.015)
    assert np.array_equal(drawn, model.sample(20000))
    assert not np.array_equal(drawn, model.sample(20000, random_state=4))


def test_the_best_path_is_the_cheapest_of_all():
    rng = np.random.default_rng(5)
    paths = rng.integers([3, 4, 3], size=(200, 3))
    model = LayeredChainModel().fit(paths, rng.random(200))
    every = np.stack(np.meshgrid(*map(np.arange, (3, 4, 3))), -1).reshape(-1, 3)
    costs = model.expected_cost(every)
    best = model.best_path()
    assert model.expected_cost(best[None])[0] == pytest.approx(costs.min())
    last = model.best_path(start=2, end=1)
    within = costs[(every[:, 0] == 2) & (every[:, 2] == 1)].min()
    assert last[[0, 2]].tolist() == [2, 1]
    assert model.expected_cost(last[None])[0] == pytest.approx(within)


@pytest.mark.parametrize("costs", [None, np.full(200, 0.5), np.full(200, 0.3)])
def test_among_equally_cheap_paths_the_likeliest_is_the_best(costs):
    """It was 0, 0, 0 whatever the data, or what rounding made the cheapest."""
    rng = np.random.default_rng(7)
    paths = rng.integers([3, 4, 3], size=(200, 3))
    paths[:80] = [2, 3, 1]
    model = LayeredChainModel().fit(paths, costs)
    every = np.stack(np.meshgrid(*map(np.arange, (3, 4, 3))), -1).reshape(-1, 3)
    scores = model.score_samples(every)
    assert model.best_path().tolist() == every[np.argmax(scores)].tolist() == [2, 3, 1]
    within = (every[:, 0] == 0) & (every[:, 2] == 2)
    likeliest = every[within][np.argmax(scores[within])]
    assert model.best_path(start=0, end=2).tolist() == likeliest.tolist() != [0, 0, 2]


def test_a_cheaper_path_is_better_than_a_likelier_one():
    """Node 2 of the middle is never worse than 1, and most take 0."""
    paths = np.array([[0, 0, 0]] * 50 + [[0, 1, 0]] * 5 + [[0, 2, 0]] * 10)
    costs = np.array([0.2] * 50 + [0.0] * 15)
    model = LayeredChainModel(shrink=0.0).fit(paths, costs)
    assert model.expected_cost([[0, 1, 0], [0, 2, 0]]) == pytest.approx([0.0, 0.0])
    assert np.argmax(model.transmat_[0]) == 0
    assert model.best_path().tolist() == [0, 2, 0]


def test_hyper_parameters_have_names():
    """As scikit-learn takes them from a constructor."""

    class Free(LayeredChainModel):
        def __init__(self, layer_sizes=None, *, floor=0.1, **more):
            super().__init__(layer_sizes, **more)
            self.floor = floor

    class Many(LayeredChainModel):
        def __init__(self, *layer_sizes):
            super().__init__(layer_sizes)

    model = Free((2, 2), prior=3.0)
    assert model.get_params() == {"layer_sizes": (2, 2), "floor": 0.1}
    assert repr(model) == "Free(layer_sizes=(2, 2), floor=0.1)"
    assert model.set_params(floor=0.2).floor == 0.2
    with pytest.raises(ChainError, match=r"^Many\(\*layer_sizes\): hyper-parameters"):
        Many(2, 2).get_params()


def test_masked_numbers_are_refused_and_an_empty_mask_is_none():
    paths, costs = np.array([[0, 1], [1, 0]]), np.array([0.1, 0.9])
    hidden, row = np.ma.masked_equal(costs, 0.9), np.ma.masked_equal(paths[0], 1)
    for given in (hidden, [0.1, np.ma.masked]):
        with pytest.raises(ChainError, match=r"^costs y \(some are masked\): need"):
            LayeredChainModel().fit(paths, given)
    model = LayeredChainModel()
    for given in (np.ma.masked_equal(paths, 0), [row, paths[1]]):
        with pytest.raises(ChainError, match="masked nodes: give all L nodes"):
            model.fit(given, costs)
    model.fit(np.ma.asarray(paths), np.ma.asarray(costs))
    with pytest.raises(ChainError, match="masked nodes: give all L nodes"):
        model.score(np.ma.masked_equal(paths, 0))


def test_the_constructor_only_stores():
    sizes = [0]  # cannot be, as fit says
    model = LayeredChainModel(sizes, prior=-1.0)
    assert model.layer_sizes is sizes
    assert model.get_params() == {
        "layer_sizes": sizes,
        "prior": -1.0,
        "shrink": None,
        "random_state": None,
    }
    with pytest.raises(ChainError):
        model.fit([[0, 0]])
    done = model.set_params(layer_sizes=(1, 2), prior=1.0).fit([[0, 0]])
    assert done is model
    assert model.layer_sizes_ == (1, 2)
    assert repr(LayeredChainModel()).startswith("LayeredChainModel(layer_sizes=None")


def test_before_fit_nothing_is_known():
    model = LayeredChainModel()
    for ask in (model.sample, model.best_path, lambda: model.score([[0, 0]])):
        with pytest.raises(NotFittedError, match="call fit first") as caught:
            ask()
        assert isinstance(caught.value, GaitchainError)


@pytest.mark.parametrize(
    ("paths", "costs", "says"),
    [
        ([], None, "one or more rows"),
        ([[0, 1], [0]], None, "different lengths"),
        ([[0.5, 1.0]], None, "integers"),
        ([[0, -1]], None, "numbered from 0"),
        ([[0, 1]], [2.0], "need 0 <= f <= 1"),
        ([[0, 1]], [0.1, 0.2], r"\(G, L\) and \(G,\)"),
        ([[0, 1], [1, 0]], ["a", "b"], r"type <U1\): need \(G,\) numbers from 0"),
        ([[0, 1], [1, 0]], [[0.1], [0.1, 0.2]], "numbers from 0 to 1"),
        ([[0, 1]], [object()], "numbers from 0 to 1"),
        ([[0, 2**40]], None, "edges, at most 50000000: number the nodes from 0 on"),
        ([[0, 2**63 - 1]], None, "without gaps"),
        (
            np.full((2, 2), 2**63 + 5, np.uint64),
            None,
            "nodes go up to 9223372036854775",
        ),
    ],
)
def test_data_that_cannot_be_are_refused(paths, costs, says):
    with pytest.raises(ChainError, match=says):
        LayeredChainModel().fit(paths, costs)


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"layer_sizes": 5}, r"layer_sizes=5: need a whole number for each layer"),
        ({"layer_sizes": np.array(5)}, "whole number for each layer"),
        ({"layer_sizes": (3.0, 3.0)}, r"\(3\.0, 3\.0\): need a whole number"),
        ({"layer_sizes": (True, 2)}, "whole number for each layer"),
        ({"layer_sizes": "34"}, "whole number for each layer"),
        ({"layer_sizes": (2**40, 2)}, "at most 50000000"),
        ({"layer_sizes": (-(2**40), -2)}, "two or more layers"),
        ({"prior": "1"}, "prior='1': need a finite weight"),
        ({"prior": None}, "prior=None: need a finite weight"),
        ({"prior": 10**400}, "prior=inf: need a finite weight above 0"),
        ({"prior": 5e-324}, "prior=5e-324: nothing of it is left in a row"),
        ({"shrink": "1"}, "shrink='1': need a finite weight"),
        ({"shrink": True}, "shrink=True: need a finite weight"),
        ({"random_state": "a"}, "random_state='a': need a whole number"),
        ({"random_state": -1}, "random_state=-1: need a whole number"),
    ],
)
def test_hyper_parameters_that_cannot_be_are_refused(settings, says):
    with pytest.raises(ChainError, match=says):
        LayeredChainModel(**settings).fit([[0, 1], [1, 0]])


def test_errors_speak_of_nodes_and_sequences():
    """The chain alone knows neither poses nor gaits."""
    model, paths = LayeredChainModel(), np.array([[0, 1], [1, 0]])
    wrong = (
        lambda: model.fit(paths[:, :1]),
        lambda: model.fit(paths, [0.1]),
        lambda: model.fit(paths, [0.1, 2.0]),
        lambda: model.fit(paths).score(3 * paths),
        lambda: model.score(np.zeros((1, 3), int)),
        lambda: model.best_path(start=7),
        lambda: model.best_path(end=-1),
    )
    for ask in wrong:
        with pytest.raises(ChainError) as caught:
            ask()
        assert not re.search("pose|gait", str(caught.value))
        assert re.search("node|sequence", str(caught.value))


def test_numbers_of_any_library_are_numbers():
    paths, costs = np.array([[0, 1], [1, 0]], np.uint8), [Fraction(1, 2), 0]
    sizes = np.array([3, 2])
    model = LayeredChainModel(sizes, prior=np.float32(1), shrink=np.int64(1))
    assert model.fit(paths, costs).layer_sizes_ == (3, 2)
    same = LayeredChainModel((3, 2), shrink=1.0).fit([[0, 1], [1, 0]], [0.5, 0.0])
    assert model.score(paths) == same.score(paths)


@pytest.mark.slow
def test_a_long_sequence_has_a_likelihood():
    """The product of 400 probabilities is too small for a number, its logarithm not."""
    rng = np.random.default_rng(6)
    model = LayeredChainModel((10,) * 400).fit(rng.integers(10, size=(50, 400)))
    paths = rng.integers(10, size=(20, 400))
    scores = model.score_samples(paths)
    edges = zip(model.transmat_, pairwise(paths[0]), strict=True)
    expected = math.log(model.startprob_[paths[0, 0]])
    expected += sum(math.log(matrix[edge]) for matrix, edge in edges)
    assert scores[0] == pytest.approx(expected)
    assert model.score(paths) == pytest.approx(scores.mean())
    assert scores.max() < math.log(sys.float_info.min)


def test_questions_that_cannot_be_are_refused():
    model = LayeredChainModel().fit([[0, 1], [1, 0]])
    with pytest.raises(ChainError, match=r"need 0\.\.1"):
        model.score([[0, 2]])
    with pytest.raises(ChainError, match=r"0\.\.1"):
        model.best_path(start=7)
    with pytest.raises(ChainError, match=r"^end=99: need node indices in 0\.\."):
        model.best_path(start=0, end=99)
    for count in (0, "a", 2.5, True, 2**70):
        with pytest.raises(ChainError, match="1 or more, a whole number up to"):
            model.sample(count)
    for seed in ("a", -1, 2.5):
        with pytest.raises(ChainError, match="need a whole number from 0 on"):
            model.sample(1, seed)
    with pytest.raises(ChainError, match="no hyper-parameter"):
        model.set_params(alpha=1.0)

import math

import pandas as pd

from bench.reports.paper_tables import make_table1, make_table2
from bench.reports.tables import Results

_NONE = pd.DataFrame()


def _row(**changes):
    row = {
        "dataset": "fr079-real",
        "world": "freiburg-079",
        "method": "paper",
        "status": "ok",
        "order": 1,
        "num_maps": 11,
        "num_placed": 11,
        "num_wrong": 0,
        "success": True,
        "max_error_m": 0.03,
        "median_error_m": 0.01,
        "objective_initial": 0.25,
        "objective": 0.22,
        "objective_floor": 0.2,
        "runtime_s": 3.0,
        "runtime_features_s": 0.5,
        "runtime_pairs_s": 2.0,
        "runtime_tree_s": 0.25,
        "runtime_averaging_s": 0.125,
    }
    return row | changes


def _results(*rows, maps=_NONE):
    return Results(pd.DataFrame(rows), maps, _NONE, ())


_RIVAL = {"method": "sequential", "num_placed": 6, "num_wrong": 2, "success": False, "objective": 2.2}


def test_table_1_sets_the_papers_figures_beside_ours():
    table, _ = make_table1(_results(_row(**_RIVAL), _row()))
    rival, own = table.to_dict("records")
    assert (rival["Suc."], rival["paper's Suc."], rival["paper's Obj."]) == ("0 of 1", "N", 4.7405)
    assert (own["Suc."], own["paper's Suc."], own["paper's Obj."]) == ("1 of 1", "Y", 0.2940)
    assert own["floor"] == 0.2


def test_table_1_says_what_agrees_what_does_not_and_over_how_many_maps():
    rival = _row(**_RIVAL, median_error_m=0.005, runtime_s=3.03)
    _, sentences = make_table1(_results(rival, _row()))
    assert (
        "fr079-real: agrees with the paper's Suc. = N for sequential: 2 of the maps placed wrong and 5 left out."
        in sentences
    )
    (objective,) = [s for s in sentences if "(Obj.)" in s]
    assert objective.startswith("fr079-real: agrees")
    assert "10 times" in objective
    assert objective.endswith("Errors of 6 placed maps against 11.")
    (median,) = [s for s in sentences if "true median error" in s]
    assert median.startswith("fr079-real: DISAGREES")
    (time,) = [s for s in sentences if "faster" in s]
    assert time.startswith("fr079-real: DISAGREES")
    assert time.endswith("equal within 2 %.")


def test_table_1_compares_no_error_with_a_method_that_placed_nothing():
    nothing = _row(**_RIVAL | {"num_placed": 0, "num_wrong": 0, "objective": math.nan}, median_error_m=math.nan)
    _, sentences = make_table1(_results(nothing, _row()))
    assert not any("accurate" in sentence for sentence in sentences)


def _orders(fine, placed):
    maps = [
        {"dataset": "fr079-real", "method": "paper", "seed": 0, "order": order, "map": name, "placed": True}
        for order, names in enumerate(placed, start=1)
        for name in names
    ]
    return _results(*[_row(order=k, objective=v) for k, v in enumerate(fine, start=1)], maps=pd.DataFrame(maps))


def test_table_2_tells_orders_that_matter_from_orders_that_do_not():
    table, sentences = make_table2(_orders([0.22, 0.22 + 1e-15], ["ab", "ba"]))
    assert table["T coarse (s)"].tolist() == [2.75, 2.75]
    assert table["paper's fine"].tolist() == [0.2940, 0.2938]
    assert "agrees that the order does not matter: fine errors differ by less than 0.01 %" in sentences[0]
    assert sentences[0].endswith("the placed maps are the same.")
    _, sentences = make_table2(_orders([0.22, 0.23], ["ab", "a"]))
    assert "DISAGREES that the order does not matter: fine errors differ by 4.4 %" in sentences[0]
    assert sentences[0].endswith("the placed maps are not the same.")

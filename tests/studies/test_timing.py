"""If these fail, what settings cost is compared at different moments of a machine, or a point's results are lost."""

from pathlib import Path

from cardiac_cosim.studies.bench import Bench
from cardiac_cosim.studies.plan import plan_study


def test_points_are_timed_in_turn_and_their_results_stay(study: Path, tmp_path: Path) -> None:
    plan = plan_study(study)
    points = plan.points[:2]
    with Bench(tmp_path / "out") as bench:
        before = bench.run(points, "first")
        written = [(trial.folder / "summary.json").stat().st_mtime_ns for trial in before]
        after = bench.time_in_turn(points, 5, "again")
        assert [len(trial.costs) for trial in after] == [5, 5]
        # The first runs count, and nothing but costs has changed.
        for old, new in zip(before, after, strict=True):
            assert new.costs[: len(old.costs)] == old.costs
            assert new.solves == old.solves
        assert [(trial.folder / "summary.json").stat().st_mtime_ns for trial in after] == written
        assert bench.time_in_turn(points, 5, "again") == after
    with Bench(tmp_path / "out") as bench:
        known = [bench.known(point) for point in points]
        assert [len(trial.costs) for trial in known if trial is not None] == [5, 5]

"""What short tasks cost through Dask: points, chunk, time, memory of scheduler and of workers, size of results. CSV.

    python benchmarks/sweep_scale.py [--points 100000] [--chunks 100,10,1]

Two worker processes on this machine; a point is the statics of a two-link arm. Needs fork1s[sweep] and distributed.
docs/scale.md reads the figures.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import fork1s

ARM = Path(__file__).resolve().parents[1] / "scenes" / "two_link_arm.xml"


def metric(model, point):
    answer = fork1s.statics(model, "forearm", force=[0, 1e-5 * (1 + point["push"]), 0], gravity=[0, 0, 0])
    return float(answer.moved[1])


def megabytes(pid):
    import psutil

    return psutil.Process(pid).memory_info().rss / 1e6


def measure(points, chunk, client):
    largest = [0.0, 0.0]
    workers = list(client.run(os.getpid).values())

    def watch(done, total):
        if done % 1000 < chunk:
            largest[0] = max(largest[0], megabytes(os.getpid()))
            largest[1] = max(largest[1], *(megabytes(w) for w in workers))

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "t.parquet"
        last = [0.0, 0]

        def progress(done, total):
            watch(done, total)
            if done == total:
                last[0] = time.perf_counter()
                last[1] = (path.parent / "t.parquet.journal").stat().st_size

        start, cpu = time.perf_counter(), time.process_time()
        table = fork1s.sweep(
            ARM,
            {"push": range(points)},
            metric,
            client.get_executor(),
            path=path,
            progress=progress,
            chunk=chunk,
        )
        end = time.perf_counter()
        assert len(table) == points and table["error"].isna().all() and table["metric"].is_unique
        print(
            f"{points},{chunk},{end - start:.1f},{time.process_time() - cpu:.1f},{table['seconds'].sum():.1f},{end - last[0]:.2f},"
            f"{largest[0]:.0f},{largest[1]:.0f},{last[1] / 1e6:.1f},{path.stat().st_size / 1e6:.2f}",
            flush=True,
        )


def main():
    from distributed import Client, LocalCluster

    arguments = argparse.ArgumentParser()
    arguments.add_argument("--points", type=int, default=100_000)
    arguments.add_argument("--chunks", default="100,10,1")
    given = arguments.parse_args()
    print(
        "points,chunk,wall_s,cpu_of_caller_and_scheduler_s,in_points_s,writing_s,caller_and_scheduler_MB,worker_MB,journal_MB,"
        "parquet_MB"
    )
    with LocalCluster(
        2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        with Client(cluster) as client:
            for chunk in map(int, given.chunks.split(",")):
                measure(given.points, chunk, client)


if __name__ == "__main__":
    sys.exit(main())

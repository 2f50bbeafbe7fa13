"""Several vehicles at a time, as far as nothing flies."""

from dfvs_sim.demo.fleet import Member, fly_together
from dfvs_sim.demo.image_size import is_shared, measured_size
from dfvs_sim.demo.results.summary import flight_table


def member(folder, number, *words):
    path = folder / f"vehicle-{number}"
    path.mkdir()
    return Member(f"drone-{number}", number, 10 + number, path, words)


def test_what_belongs_to_a_member_counts_before_the_words_of_all(tmp_path):
    words = member(tmp_path, 2, "--seed", "3", "--out", "elsewhere", "--goal", "0,0,-1,0").command
    for option, value in (("--seed", "12"), ("--name", "drone-2"), ("--system-id", "2")):
        last = len(words) - 1 - words[::-1].index(option)
        assert words[last + 1] == value


def test_members_that_cannot_fly_say_why_behind_their_names(tmp_path):
    members = [member(tmp_path, number, "--size", "big") for number in (1, 2)]
    members[0].summary.write_text('{"converged": true}')  # of an earlier flight
    said = []
    assert fly_together(members, said.append) == [2, 2]
    assert sorted(said) == [
        f"drone-{k}: error: --size is 'big'; expected WIDTHxHEIGHT such as 320x240" for k in (1, 2)
    ]
    table = flight_table([m.document() for m in members])
    assert table.count("no flight") == 2
    assert table.endswith("0 of 2 converged")


def test_vehicles_that_share_too_few_cores_get_the_smallest_pictures(monkeypatch):
    monkeypatch.setattr("os.cpu_count", lambda: 2)
    assert is_shared(2)
    assert not is_shared(1)
    assert measured_size(lambda _: None, vehicles=2) == "192x144"
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    assert not is_shared(4)


def test_a_table_has_a_line_for_every_vehicle():
    flown = {
        "vehicle": "drone-1",
        "seed": 4,
        "converged": True,
        "end_state": "DONE",
        "initial_translation_m": 1.0,
        "initial_rotation_deg": 20.0,
        "final_translation_m": 0.012,
        "final_rotation_deg": 0.3,
        "duration_s": 11.0,
        "path_ratio": 1.1,
    }
    lost = flown | {"vehicle": "drone-2", "converged": False, "end_state": "ABORT"}
    head, first, second, last = flight_table([flown, lost | {"path_ratio": None}]).splitlines()
    assert " ".join(first.split()) == "drone-1 4 1.00 20.0 1.20 0.30 11.0 1.10 converged"
    assert second.split()[-2:] == ["-", "ABORT"]
    assert len(head) <= len(first)
    assert last == "1 of 2 converged"

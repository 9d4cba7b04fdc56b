import base64
import json

import numpy as np
import pytest
from api_setup import RUN, snapshot
from spatial_setup import image_config, some_policy, toy_frames

from taskschema.config import RunConfig
from taskschema.policies import Policy
from taskschema.tasks import get_task

FIELDS = {"handles": [0.01, -0.05, 0.02, 0.06], "holding": [0, 0], "timestep": [1, 0, 0]}
VECTOR = [0.01, -0.05, 0.02, 0.06, 0, 0, 1, 0, 0]


def act(client, **body):
    # Written here, because httpx itself refuses to send some of what is to be refused.
    content = json.dumps({"observation": VECTOR, "step": 0, **body})
    return client.post("/act", content=content, headers={"Content-Type": "application/json"})


def test_mean_is_what_the_policy_itself_says(served):
    task = get_task("toy")
    observation = np.array([VECTOR], dtype=np.float32)
    expected = Policy(snapshot(3), task.pairs, task.observation).act_mean(observation, 0)
    answer = act(served.http, mode="mean").json()
    assert answer["pair"] == ["reach", "reach"] == list(task.pairs.pairs[expected.pairs[0]])
    left, right = answer["left"]["arguments"], answer["right"]["arguments"]
    given = [left["x"]["value"], left["y"]["value"], right["x"]["value"], right["y"]["value"]]
    # left: x, y, distance; right: x, y, distance
    assert given == expected.arguments[0][[0, 1, 3, 4]].tolist()
    assert {value["unit"] for value in left.values()} == {"m"}
    assert (answer["run"], answer["version"], answer["step"], answer["seed"]) == (RUN, 3, 0, None)


def test_fields_by_name_mean_the_same_as_the_vector(served):
    named = act(served.http, observation=FIELDS, mode="mean")
    assert named.status_code == 200
    assert named.content == act(served.http, mode="mean").content


def test_the_schema_row_of_the_step_chooses(served):
    answer = act(served.http, step=1, mode="mean").json()
    assert answer["left"]["skill"] == answer["right"]["skill"] == "raise"
    assert list(answer["left"]["arguments"]) == ["distance"]
    assert 0 <= answer["left"]["arguments"]["distance"]["value"] <= 0.5


def test_a_seed_repeats_a_sample_and_the_answer_tells_it(served):
    drawn = act(served.http, step=2).json()
    again = act(served.http, step=2, seed=drawn["seed"]).json()
    assert again == drawn
    # Row 3 is uniform over nine pairs: forty equal draws would be a miracle.
    assert len({str(act(served.http, step=2, seed=seed).json()["pair"]) for seed in range(40)}) > 1


def test_skills_without_arguments_come_without(served):
    answers = [act(served.http, step=2, seed=seed).json() for seed in range(40)]
    idle = [answer[arm] for answer in answers for arm in ("left", "right") if answer[arm]["skill"] == "no_op"]
    assert idle
    assert all(call["arguments"] == {} for call in idle)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"step": 3}, "step must be 0 to 2 for toy, got 3."),
        ({"step": -1}, "body.step"),
        ({"step": 1.5}, "body.step"),
        ({"step": True}, "body.step"),
        ({"step": None}, "body.step"),
        ({"step": 10**30}, "body.step"),
        ({"seed": -1}, "body.seed"),
        ({"mode": "best"}, "body.mode"),
        ({"observation": VECTOR[:-1]}, "observation has 8 numbers, this task's has 9"),
        ({"observation": []}, "observation has 0 numbers"),
        ({"observation": [*VECTOR[:-1], "1"]}, "body.observation.vector.8"),
        ({"observation": [*VECTOR[:-1], None]}, "body.observation.vector.8"),
        ({"observation": [*VECTOR[:-1], True]}, "body.observation.vector.8"),
        ({"observation": [*VECTOR[:-1], 1e300]}, "observation must hold finite numbers"),
        ({"observation": [*VECTOR[:-1], 10**400]}, "body.observation.vector.8"),
        ({"observation": 5}, "body.observation: must be an object of fields or a list"),
        ({"observation": "text"}, "This run sees states"),
        ({"observation": None}, "body.observation: must be an object of fields or a list"),
        ({"observation": {}}, "observation lacks: handles, holding, timestep."),
        ({"observation": {**FIELDS, "handels": [1]}}, "Did you mean 'handles'?"),
        ({"observation": {**FIELDS, "holding": [1]}}, "observation.holding has 1 numbers, expected 2 [1]."),
        ({"observation": {**FIELDS, "holding": 1}}, "observation.holding has 1 numbers"),
        ({"colour": "red"}, "body.colour"),
        ({"observation": {"\ud800": [1]}}, "Unknown observation field"),
    ],
)
def test_a_wrong_request_gets_one_line(served, change, says):
    answer = act(served.http, **change)
    assert answer.status_code == 422
    assert says in answer.json()["detail"]
    assert "\n" not in answer.json()["detail"]


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite_are_refused(served, number):
    body = f'{{"observation": [{number}, 0, 0, 0, 0, 0, 0, 0, 0], "step": 0}}'
    answer = served.http.post("/act", content=body, headers={"Content-Type": "application/json"})
    assert answer.status_code == 422
    assert answer.json()["detail"].startswith("body.observation.vector.0: ")


def test_a_huge_body_is_refused(served):
    answer = act(served.http, observation=[0.5] * 100_000)
    assert answer.status_code == 413
    assert answer.text == "Content Too Large"


def test_a_huge_body_of_unknown_length_is_refused(served):
    def chunks():
        for _ in range(400):
            yield b" " * 1000

    answer = served.http.post("/act", content=chunks(), headers={"Content-Type": "application/json"})
    assert answer.status_code == 413


@pytest.fixture
def pictures(served):
    served.records.register_run("pictures", image_config())
    policy = some_policy(logits=snapshot(3).logits)
    served.records.write_policy("pictures", policy.snapshot)
    return policy


def see(served, frame, **body):
    data = base64.b64encode(frame.tobytes()).decode()
    return served.http.post("/act?run=pictures", json={"observation": data, "step": 0, **body})


def test_a_run_on_images_takes_a_frame_and_shows_its_response_maps(served, pictures):
    frames = toy_frames(1)
    answer = see(served, frames[0], mode="mean", response_maps=True).json()
    expected = pictures.act_mean(frames, 0)
    assert answer["pair"] == ["reach", "reach"]
    assert answer["left"]["arguments"]["x"]["value"] == pytest.approx(expected.arguments[0][0], rel=1e-4)
    maps = answer["response_maps"]
    assert maps["x"] == maps["y"] == [-0.1, 0.1]
    assert np.array([maps["left"], maps["right"]]) == pytest.approx(
        pictures.response_maps(frames)[0], rel=1e-4
    )  # BLAS may use another number of threads there
    assert np.sum(maps["left"]) == pytest.approx(1.0)
    assert see(served, frames[0]).json()["response_maps"] is None


def test_what_is_no_frame_is_one_clear_line(served, pictures):
    frame = toy_frames(1)[0]
    for body, line in (
        (see(served, frame[:100]), "expected 196608"),
        (see(served, frame * 0), "black"),
        (see(served, frame[..., ::-1]), "observation: frame 0 shows a blue table"),
        (served.http.post("/act?run=pictures", json={"observation": "?", "step": 0}), "not base64"),
        (served.http.post("/act?run=pictures", json={"observation": VECTOR, "step": 0}), "sees images"),
        (act(served.http, observation="AAAA"), "sees states"),
        (act(served.http, response_maps=True), "only a policy on images"),
    ):
        assert body.status_code == 422
        assert line in body.json()["detail"]


def test_a_task_file_that_does_not_load_here_is_told(served):
    config = RunConfig(task="Mine", task_source="import a_module_that_is_not_here")
    served.records.register_run("mine", config)
    served.records.write_policy("mine", snapshot(1))
    answer = served.http.post("/act?run=mine", json={"observation": VECTOR, "step": 0})
    assert answer.status_code == 409
    assert "a_module_that_is_not_here" in answer.json()["detail"]

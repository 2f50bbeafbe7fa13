import pytest

from dfvs_core.gate.config import GateConfig
from dfvs_core.gate.events import Heartbeat, VehicleMode
from dfvs_core.gate.machine import GateMachine
from dfvs_core.messages.link import from_gate, to_datagram
from dfvs_service.gate.status import gate_status

S = 1_000_000_000


def status(machine, now_ns):
    return gate_status(machine, now_ns, challenge="", command=("", 0), warnings=())


def test_a_status_tells_since_when_the_state_is():
    machine = GateMachine(GateConfig(), 5 * S)
    assert status(machine, 7 * S).since_ns == 5 * S
    machine.step(8 * S, [Heartbeat(8 * S, VehicleMode.HOLD, armed=True)])
    machine.step(8 * S + 20)
    assert status(machine, 9 * S).state == "PREFLIGHT"
    assert status(machine, 9 * S).since_ns == pytest.approx(8 * S, abs=20)


@pytest.mark.parametrize("sign", ["w", "録", "\U0001f681", '"', "\0"])
def test_long_texts_in_any_script_fit_one_datagram(sign):
    machine = GateMachine(GateConfig(), 5 * S)
    machine.reason = 1000 * sign
    told = gate_status(
        machine, 7 * S, challenge="c" * 32, command=(200 * sign, 1), warnings=(1000 * sign,) * 9
    )
    assert from_gate(to_datagram(told)) == told
    for text in (told.cause, *told.warnings):
        assert len(text) >= 25
        assert set(text) == {sign}

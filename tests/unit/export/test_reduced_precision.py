"""Training in bfloat16, where that is quicker than in float32."""

import pytest
import torch

from dfvs_export.training.descent import bfloat16_where_quick


@pytest.mark.parametrize(
    ("able", "computed"),
    [
        ({"avx512_f": True, "avx512_bf16": False}, torch.float32),
        ({"avx512_bf16": True}, torch.bfloat16),
        ({"amx_bf16": True}, torch.bfloat16),
        ({"architecture": "aarch64"}, torch.float32),
    ],
)
def test_it_is_used_on_processors_that_have_instructions_for_it(monkeypatch, able, computed):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: able)
    with bfloat16_where_quick():
        product = torch.ones(2, 2) @ torch.ones(2, 2)
    assert product.dtype is computed

# SPDX-License-Identifier: Apache-2.0
"""A small stereo network and its training, by PyTorch (pip install torch onnx); what it becomes is an ONNX file.

Both images' features are compared at a quarter of the resolution for every disparity (a cost volume), the volume is
smoothed by 3D convolutions, its soft minimum is the disparity (Kendall et al., GC-Net, ICCV 2017), and a second network
looks at the features beside it at full resolution for what is left of the error, and for how likely the disparity is
right (Khamis et al., StereoNet, ECCV 2018)."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.nn import functional as F

from matchers.pairs import Pairs
from activestereo.sensor.foreign_matcher import METADATA

FEATURES, GROUPS, VOLUME_CHANNELS, REFINER_CHANNELS = 16, 4, 8, 16
_COARSE = 4  # pixels to one of the cost volume's
_WINDOW_PX = 9  # of the local mean and contrast that images are normalised by
_NOISE = 1.0 / 255.0
_NEAR = (-1.0, -0.5, 0.0, 0.5, 1.0)  # pixels beside the disparity, which the refiner compares
_RIGHT_PX = 1.0  # a disparity is right within this
_CROP_PX = (96, 256)
_RATE, _BATCH = 3e-3, 4


class StereoNetwork(nn.Module):
    """(left, right) [1, 1, height, width] in 0..1, sides multiples of 4 -> disparity in pixels, -1 where it is more
    likely wrong than right, and confidence 0..1, both [1, 1, height, width]. most_px: disparities that are searched."""

    def __init__(self, most_px: int) -> None:
        super().__init__()
        self.most_px = most_px
        self.features = nn.Sequential(
            nn.Conv2d(1, FEATURES, 5, padding=2), nn.ReLU(), nn.Conv2d(FEATURES, FEATURES, 3, padding=1)
        )
        self.coarse = nn.Sequential(
            nn.Conv2d(FEATURES, FEATURES, 3, stride=2, padding=1), nn.ReLU(),
            nn.Conv2d(FEATURES, FEATURES, 3, stride=2, padding=1), nn.ReLU(),
            nn.Conv2d(FEATURES, FEATURES, 3, padding=1),
        )  # fmt: skip
        self.smooth = nn.Sequential(
            nn.Conv3d(GROUPS, VOLUME_CHANNELS, 3, padding=1), nn.ReLU(),
            nn.Conv3d(VOLUME_CHANNELS, VOLUME_CHANNELS, 3, padding=(1, 2, 2), dilation=(1, 2, 2)), nn.ReLU(),
            nn.Conv3d(VOLUME_CHANNELS, VOLUME_CHANNELS, 3, padding=(1, 4, 4), dilation=(1, 4, 4)), nn.ReLU(),
            nn.Conv3d(VOLUME_CHANNELS, 1, 3, padding=1),
        )  # fmt: skip
        self.refine = nn.Sequential(
            nn.Conv2d(len(_NEAR) + 4, REFINER_CHANNELS, 3, padding=1), nn.ReLU(),
            nn.Conv2d(REFINER_CHANNELS, REFINER_CHANNELS, 3, padding=2, dilation=2), nn.ReLU(),
            nn.Conv2d(REFINER_CHANNELS, REFINER_CHANNELS, 3, padding=4, dilation=4), nn.ReLU(),
            nn.Conv2d(REFINER_CHANNELS, 2, 3, padding=1),
        )  # fmt: skip

    def forward(self, left: torch.Tensor, right: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        _, disparity, logit = self.all_of(left, right)
        confidence = torch.sigmoid(logit)
        return torch.where(confidence > 0.5, disparity, torch.full_like(disparity, -1.0)), confidence

    def all_of(self, left: torch.Tensor, right: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """(disparity before it is refined, disparity, logit of the confidence), each [n, 1, height, width]."""
        a, b = _even(left), _even(right)
        fine_a, fine_b = self.features(a), self.features(b)
        scores = self.smooth(_volume(self.coarse(fine_a), self.coarse(fine_b), self.most_px // _COARSE))[:, 0]
        share = torch.softmax(scores, dim=1)
        steps = torch.arange(self.most_px // _COARSE, dtype=share.dtype, device=share.device)[None, :, None, None]
        coarse = (share * steps).sum(1, keepdim=True)
        spread = (share * (steps - coarse).abs()).sum(1, keepdim=True)
        size = left.shape[-2:]
        first = _COARSE * F.interpolate(coarse, size=size, mode="bilinear", align_corners=False)
        doubt = F.interpolate(spread, size=size, mode="bilinear", align_corners=False)
        near = torch.cat([(fine_a * _moved(fine_b, first + step)).mean(1, keepdim=True) for step in _NEAR], 1)
        seen = torch.cat([near, a, _moved(b, first), doubt, first / self.most_px], 1)
        change, logit = self.refine(seen).split(1, dim=1)
        return first, F.relu(first + change), logit


def _even(image: torch.Tensor) -> torch.Tensor:
    """Without local mean and contrast."""
    half = _WINDOW_PX // 2
    mean = F.avg_pool2d(image, _WINDOW_PX, 1, half, count_include_pad=False)
    variance = F.avg_pool2d((image - mean) ** 2, _WINDOW_PX, 1, half, count_include_pad=False)
    return (image - mean) / (variance.sqrt() + 2.0 * _NOISE)


def _volume(left: torch.Tensor, right: torch.Tensor, count: int) -> torch.Tensor:
    """[n, GROUPS, count, height, width]: products of features, means of each group."""
    n, channels, height, width = left.shape
    grouped = [
        (left * F.pad(right, (d, 0))[..., :width]).reshape(n, GROUPS, channels // GROUPS, height, width).mean(2)
        for d in range(count)
    ]
    return torch.stack(grouped, dim=2)


def _moved(right: torch.Tensor, disparity: torch.Tensor) -> torch.Tensor:
    """The right image where the left one's pixels see it."""
    height, width = right.shape[-2:]
    y = torch.arange(height, dtype=right.dtype, device=right.device)[None, :, None].expand(len(right), -1, width)
    x = torch.arange(width, dtype=right.dtype, device=right.device)[None, None, :] - disparity[:, 0]
    grid = torch.stack([2.0 * x / (width - 1) - 1.0, 2.0 * y / (height - 1) - 1.0], dim=-1)
    return F.grid_sample(right, grid, mode="bilinear", padding_mode="border", align_corners=True)


def train(
    pairs: Pairs, most_px: int, steps: int, seed: int, progress: Callable[[float], object] = lambda share: None
) -> StereoNetwork:
    """A network from its first weight, by crops of the pairs; on a GPU where PyTorch has one. The same seed gives the
    same network on one machine's processor."""
    torch.manual_seed(seed)
    random, device = np.random.default_rng(seed), "cuda" if torch.cuda.is_available() else "cpu"
    network = StereoNetwork(most_px).to(device)
    optimizer = torch.optim.Adam(network.parameters(), lr=_RATE)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, _RATE, total_steps=steps)
    for step in range(steps):
        left, right, truth = (torch.from_numpy(one).to(device) for one in _crops(pairs, random))
        first, disparity, logit = network.all_of(left, right)
        loss = _loss(first, disparity, logit, truth, most_px)
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimizer.step()
        schedule.step()
        progress((step + 1) / steps)
    return network.cpu().eval()


def _loss(
    first: torch.Tensor, disparity: torch.Tensor, logit: torch.Tensor, truth: torch.Tensor, most_px: int
) -> torch.Tensor:
    """Errors of both disparities where the truth is known, and how well the confidence foretells the second's; where
    one camera sees nothing it shall be none."""
    is_known = torch.isfinite(truth) & (truth < most_px - 2)
    error, before = ((one - truth)[is_known] for one in (disparity, first))
    is_right = torch.zeros_like(logit)
    is_right[is_known] = (error.detach().abs() < _RIGHT_PX).to(logit.dtype)
    zero = torch.zeros_like(error)
    distance = F.smooth_l1_loss(error, zero, beta=0.5) + 0.5 * F.smooth_l1_loss(before, zero)
    return distance + 0.3 * F.binary_cross_entropy_with_logits(logit, is_right)


def _crops(pairs: Pairs, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    height, width = pairs.left.shape[1:]
    rows, columns = min(height, _CROP_PX[0]), min(width, _CROP_PX[1])
    out: list[list[np.ndarray]] = [[], [], []]
    for number in random.integers(len(pairs.left), size=_BATCH):
        y, x = int(random.integers(height - rows + 1)), int(random.integers(width - columns + 1))
        part = np.s_[number, y : y + rows, x : x + columns]
        light = random.uniform(0.6, 1.4)
        for to, one in zip(out, (pairs.left, pairs.right), strict=False):
            counts = light * one[part].astype(np.float32) + random.normal(0.0, 0.5, (rows, columns))
            to.append((np.clip(np.rint(counts), 0, 255) / 255.0).astype(np.float32))
        out[2].append(pairs.truth[part])
    left, right, truth = (np.stack(one)[:, None] for one in out)
    return left, right, truth


def write_onnx(network: StereoNetwork, path: Path) -> None:
    """The file that StereoDepthSensor(matcher=...) takes, for images of any size."""
    import onnx

    example = torch.zeros(1, 1, 64, 96), torch.zeros(1, 1, 64, 96)
    sides = {0: "one", 2: "height", 3: "width"}
    torch.onnx.export(
        network, example, str(path), input_names=["left", "right"], output_names=["disparity", "confidence"],
        dynamic_axes={name: sides for name in ("left", "right", "disparity", "confidence")}, opset_version=17,
        dynamo=False,
    )  # fmt: skip
    model = onnx.load(str(path))
    entry = model.metadata_props.add()
    entry.key, entry.value = METADATA, json.dumps({"confidence": "confidence", "multiple": _COARSE})
    onnx.save(model, str(path))

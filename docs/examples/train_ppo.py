# SPDX-License-Identifier: Apache-2.0
"""
A Go2 learns by PPO: `python train_ppo.py STEPS FILE.onnx`, then `wasd go2 --policy FILE.onnx`.

Needs the extra train. Two processes simulate.
"""

from pathlib import Path
import sys

from policy_player.onnx_writer import write_layers
from stable_baselines3 import PPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv
from torch import nn
from wasd.environment import SPEC

HIDDEN = [256, 128]


def train(steps: int, seed: int = 0) -> PPO:
    """Return what has learned from so many steps."""
    env = make_vec_env(
        'wasd.environment:wasd/Go2-v0',
        n_envs=2,
        seed=seed,
        vec_env_cls=SubprocVecEnv,
        env_kwargs={'randomise': 0.0},
    )
    ppo = PPO(
        'MlpPolicy',
        env,
        learning_rate=3e-4,
        n_steps=2048,
        batch_size=1024,
        n_epochs=5,
        gamma=0.99,
        policy_kwargs={'net_arch': HIDDEN, 'activation_fn': nn.ELU, 'log_std_init': -1.0},
        seed=seed,
        device='cpu',
        verbose=1,
    )
    ppo.learn(steps)
    env.close()
    return ppo


def save(ppo: PPO, path: Path) -> None:
    """Write the network that acts, with what it was trained with."""
    parts = [*ppo.policy.mlp_extractor.policy_net, ppo.policy.action_net]
    layers = [
        (part.weight.detach().numpy(), part.bias.detach().numpy())
        for part in parts
        if isinstance(part, nn.Linear)
    ]
    write_layers(path, SPEC, layers)


if __name__ == '__main__':
    save(train(int(sys.argv[1])), Path(sys.argv[2]))

"""Train the network of poses on a corpus, its loop from top to bottom; judge it on held-out sentences, save the model.

python train/network.py CORPUS -o network.safetensors [--steps 700] [--seed 0]

Sound, phones and emotion go in, 25 to 45 times a second: four frames of 64 log-mel bands, which phone it is and how far it has
come, which emotion. Out comes the pose in the middle of those that go with them, as 30 principal components. What is made small
is the distance of points, lips four times as much as others, and of their velocities. Windows of about two seconds are drawn
from the recordings, a little faster or slower, louder or softer, with noise and silent bands: two hundred sentences are few.
The weights that are kept are the mean of those of the last hundred steps or so.

Beside the network stands a linear regression, by least squares, from the same bands and a layer of the network that hears phones,
eleven frames around each. What is said is 0.6 of the one and 0.4 of the other (0.8 and 0.2 among several emotions): they err in
different places.
"""

import argparse
from copy import deepcopy
from pathlib import Path

import numpy as np
import torch
from torch import nn

from facesynth.corpus import Corpus
from facesynth.device import device_of
from facesynth.evaluation.dynamics import energy_ratio
from facesynth.evaluation.geometry import lve
from facesynth.methods.learn.expectation import STEPS, average, learning
from facesynth.methods.network.method import Network

EVERY = 100
"""Steps between two looks at the held-out sentences."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("corpus", type=Path)
    parser.add_argument("-o", "--output", type=Path, default=Path("network.safetensors"))
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--device", default="auto", help="auto, cpu, cuda or mps")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    # load
    recorded, held_out = Corpus.open(options.corpus).split(options.seed)
    device = device_of(options.device)
    model = Network(steps=options.steps).to(device)
    model.learned_from(recorded)
    predictor = model.predictor

    # prepare: what is heard in every recording and its components, how they are standardised, first weights
    windows = predictor.prepare(recorded, options.seed)
    predictor.answer_in(nn.Identity())

    # the regression beside the network: one solution, no steps
    predictor.learn_beside(windows)
    print(f"a regression stands beside the network, {predictor.linear.share:.0%} of the pose is its")

    # the network: what is made small, its averaged weights, how it learns
    loss_of, network = predictor.loss(recorded.layout), predictor.network
    averaged, (steps, optimiser, schedule, largest_gradient) = deepcopy(network), learning(network, options.steps)
    rng, losses = np.random.default_rng(options.seed), []
    print(f"{len(recorded)} recordings, {sum(p.numel() for p in network.parameters()):,} weights")

    # train
    network.train()
    torch.manual_seed(options.seed)
    for step in range(steps):
        batch = windows.draw(rng).to(device)
        poses, log_deviations = network(batch.told)
        loss = loss_of(poses, log_deviations, batch)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), largest_gradient)
        optimiser.step()
        schedule.step()
        average(averaged, network, step)
        losses.append(loss.item())
        if (step + 1) % EVERY == 0 or step + 1 == steps:
            predictor.network = averaged.eval()
            made = [(model.synthesize(utterance.speech), utterance.motion) for utterance in held_out]
            lips, energy = (np.mean([figure(*pair) for pair in made]) for figure in (lve, energy_ratio))
            print(
                f"step {step + 1}: loss {np.mean(losses[-EVERY:]):.3f}, held out: lips {lips:.3f}, energy {energy:.2f}",
                flush=True,
            )

    # save
    model.save(options.output)
    print(f"saved {options.output}")


if __name__ == "__main__":
    main()

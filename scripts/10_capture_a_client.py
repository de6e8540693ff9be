"""A whole manoeuvre: reorientation, approach, capture, stop and berth.

``python scripts/10_capture_a_client.py`` ends in the rate [deg/s] of servicer and client after the
capture, if the joints were locked.

A servicer of 300 kg is turned by 40 deg away from an attitude that suits the approach. It turns
itself by its arm, follows the grapple point of a client that tumbles at 1.2 deg/s, takes
hold of it, brings it to rest relative to itself, and berths it. ``freefloat models
servicing/capture_client`` prints the scenario.
"""

import numpy as np

import freefloat as ff

scenario = ff.load_scenario("servicing/capture_client")

# The attitude nearest to the present one from which the approach can be followed is found first.
# The arm turns the spacecraft there; the other phases begin where the one before ends.
manoeuvre = scenario.plan()
print(manoeuvre.reason)
for phase in manoeuvre.phases:
    print(f"  {phase.start:7.1f} s {phase.name:14} {phase.duration:5.1f} s {phase.reason}")

turned = manoeuvre.phases[0].motion
angle = ff.so3.angle_between(turned.initial.attitude, turned.final.attitude)
print(f"the arm turns the spacecraft by {np.degrees(angle):.1f} deg")

# The page plays all phases one after another, or one of them.
ff.playback(manoeuvre, "capture_client").save("capture_client.html")
print("page: capture_client.html")

# Turn of the spacecraft, joints and margin over all phases.
ff.figures(manoeuvre)["manoeuvre"].savefig("manoeuvre.png", dpi=150)
print("drawn: manoeuvre.png")

# All phases are integrated again and simulated with MuJoCo, and each begins where another ends.
ff.save(manoeuvre, "manoeuvre.h5")
print(f"verified: {ff.check(ff.load('manoeuvre.h5'), 'mujoco').passed}")

# Velocities match at contact, so there is no impulse; the client brings its momentum along.
capture = next(phase.result for phase in manoeuvre.phases if phase.kind == "capture")
print(f"impulse: {np.linalg.norm(capture.impulse[:3]):.1e} N s")
print(f"with locked joints: {np.degrees(np.linalg.norm(capture.locked_rate)):.3f} deg/s")

"""Child process with ur_rtde's control interface, which may abort its process: `HOST FREQUENCY DECELERATION`.

It writes `ready`. Then, for each line that it reads, it stops the robot and writes `stopped`.
"""

import sys


def main(host: str, frequency: float, deceleration: float) -> None:
    """Serve until standard input ends."""
    try:
        from rtde_control import RTDEControlInterface
    except ImportError:
        print("it is not installed for this Python; another stop action does not need it", flush=True)
        return
    try:
        control = RTDEControlInterface(host, frequency)
    except Exception as error:
        print(f"cannot control the robot at {host}: {error}", flush=True)
        return
    print("ready", flush=True)
    for _ in sys.stdin:
        control.stopJ(deceleration)
        print("stopped", flush=True)


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), float(sys.argv[3]))

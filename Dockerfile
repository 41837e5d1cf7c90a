# The page of a Go2 from a plain Debian; on aarch64 without ROS, whose wheels are for x86_64.
#
#   .ci/wheels dist && docker build -t wasd . && docker run --rm -it --network host wasd
#
# The page serves 127.0.0.1 alone, so the container shares the network of its host.
FROM debian:12-slim
RUN apt-get update && apt-get install -y --no-install-recommends python3 python3-venv libegl1 libosmesa6
COPY dist /wheels
RUN python3 -m venv /opt/wasd
RUN /opt/wasd/bin/pip install --no-cache-dir --find-links /wheels wasd-robots
RUN useradd --create-home driver
USER driver
WORKDIR /home/driver
# Once, in the image: the first start would take a minute longer.
RUN /opt/wasd/bin/python -P -m quadruped_sim
ENTRYPOINT ["/opt/wasd/bin/wasd"]
CMD ["go2", "--viewer", "web", "--port", "8765"]

# docker build -t contact-fenicsx .
# docker run --rm -v "$PWD:/case" contact-fenicsx python3 -m contact solve case.toml --out results
FROM debian:trixie-slim

COPY scripts/debian-packages.txt /tmp/
RUN apt-get update \
    && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        $(sed 's/#.*//' /tmp/debian-packages.txt) \
    && rm -rf /var/lib/apt/lists/* /tmp/debian-packages.txt

COPY . /opt/contact-fenicsx
# compiled forms, for any user (docker run -u)
ENV XDG_CACHE_HOME=/tmp/cache
WORKDIR /case
ENTRYPOINT ["/opt/contact-fenicsx/scripts/fx"]
CMD ["bash"]

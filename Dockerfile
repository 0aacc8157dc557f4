# Debian 12 with the packages that build and test Palpate: `docker build -t palpate .`, then
# `docker run --rm -it -v "$PWD":/palpate palpate CMake/test.sh`.
FROM debian:12
COPY CMake/packages.sh /tmp/packages.sh
RUN bash /tmp/packages.sh build python test matrix && rm -rf /tmp/packages.sh /var/lib/apt/lists/*
WORKDIR /palpate
CMD ["bash"]

# Stands in for Prometheus' own image where there is no registry to pull that from: Debian's build of it.
FROM python:3.11.14-slim-bookworm
RUN apt-get update -qq \
 && apt-get install -y -qq --no-install-recommends prometheus wget \
 && install -d -o 65534 -g 65534 /prometheus

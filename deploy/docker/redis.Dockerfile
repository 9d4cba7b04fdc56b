# Redis with this project's users: append-only, nobody without a password.
FROM redis:7.2.11-bookworm
COPY deploy/redis/start.sh deploy/redis/users.acl.template /opt/taskschema/deploy/
RUN install -d -o 10001 -g 10001 /data
USER 10001:10001
ENTRYPOINT []
CMD ["/opt/taskschema/deploy/start.sh"]

// A whole screen: who is there, what it does, where it is, and three orders.
const show = (id, text) => (document.getElementById(id).textContent = text);
const state = {};
let last = 0;
const socket = new WebSocket(`${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/rpc`);
const ask = (method, params = {}) => socket.send(JSON.stringify({ jsonrpc: "2.0", id: ++last, method, params }));
const order = (method) => ask(method, { request_id: crypto.randomUUID?.() ?? `${Date.now()}-${last}` });
socket.onopen = () => {
  const token = new URLSearchParams(location.hash.slice(1)).get("token");
  ask("client.identify", { name: "example", ...(token && { token }) });
  ask("subscribe", { rate_hz: 10 });
};
socket.onmessage = ({ data }) => {
  const { result, params, error } = JSON.parse(data);
  if (error) show("said", error.message);
  Object.assign(state, result?.state, params?.changed);
  if (!state.axes) return;
  show("machine", state.machine);
  show("state", `${state.state}, line ${state.line}${state.alarm ? `, alarm: ${state.alarm}` : ""}`);
  show("position", state.axes.map(({ axis }, at) => `${axis} ${state.position_mm[at].toFixed(3)}`).join("\n"));
};
socket.onclose = ({ reason }) => show("state", `no connection: ${reason}`);
for (const id of ["hold", "resume", "stop"]) document.getElementById(id).onclick = () => order(id);

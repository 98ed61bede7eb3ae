import{ai as p,aj as t,ak as c}from"./index-8TN_Jly9.js";function l(n,s,...e){var r=new c(n);p(()=>{const a=s()??null;r.ensure(a,a&&(o=>a(o,...e)))},t)}export{l as s};
